"""What readings say of signs and sizes equals regressions over the weighted past, and pulses by hand."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from rsea_ros.control.controller import Measurement
from rsea_ros.control.sign_evidence import SIGNS, SignEvidence
from rsea_ros.model.rig import END_NAMES, Sensor

RATE, PULSE = 200.0, 5.0
H, J, B, K = 1.0 / RATE, 0.9, 3.0, 1500.0


class Bench(dict):
    """Values of a rig, its sensors and clamped ends."""

    sensors, clamped = {}, set(END_NAMES)


RIG = Bench({"rotor.reflected_inertia": J, "rotor.reflected_damping": B, "spring.stiffness": K})
N = 300
T = H * np.arange(N)
SAID = "ft moved by {}, K times the gear's angle by {} N·m, and ft is {} times the motor's torque"


def noisy_rig():
    rig = Bench(RIG)
    rig.sensors = {"ft": Sensor(noise=0.3), "velocity": Sensor(noise=2e-3), "motor_torque": Sensor(noise=0.4)}
    return rig


def stream(factor=1.0, friction=0.4, bias=0.1, noise=0.05, seed=1):
    """Return ft, velocity, position and motor torque that keep to the first balance. factor: of ft in it."""
    rng = np.random.default_rng(seed)
    ft = 4.0 * np.sin(9.0 * T) + np.sin(31.0 * T)
    velocity = 0.3 * np.sin(14.0 * T + 1.0)
    position = np.cumsum(velocity) * H
    made = np.zeros(N)
    speed, mean = 0.5 * (velocity[1:] + velocity[:-1]), 0.5 * (ft[1:] + ft[:-1])
    made[1:] = factor * mean + J * np.diff(velocity) / H + B * speed + friction * np.sign(speed) + bias
    return ft, velocity, position, made + noise * rng.standard_normal(N)


def heard(evidence, ft, velocity, position, made, **options):
    return [
        evidence.hear(Measurement(*row), math.nan, 0, **options)
        for row in zip(ft, velocity, position, made, strict=True)
    ]


def rows(ft, velocity, position, made, creep=2e-3):
    """Return the rows of the balance, weighted with half a second of memory, and the torques made."""
    speed, mean = 0.5 * (velocity[1:] + velocity[:-1]), 0.5 * (ft[1:] + ft[:-1])
    x = np.column_stack([mean, J * np.diff(velocity) / H, B * speed, np.sign(speed), np.ones(N - 1)])
    weight = np.sqrt((1.0 - H / 0.5) ** np.arange(N - 1)[::-1])
    keep = np.abs(speed) > creep
    return (x * weight[:, None])[keep], (made[1:] * weight)[keep], float(np.sum(weight[keep] ** 2))


def test_misfits_of_signs_are_regressions_beside_the_rigs_values():
    given = stream()
    evidence = SignEvidence(RIG, RATE, PULSE)
    answers = heard(evidence, *given)
    ft, velocity = given[:2]
    assert answers[0] is None and answers[7] == pytest.approx((
        0.5 * (ft[7] + ft[6]), J * (velocity[7] - velocity[6]) / H + B * 0.5 * (velocity[7] + velocity[6])
    ))  # fmt: skip
    x, y, count = rows(*given)
    left = float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2)) / count
    variance = 4.0 * max((0.1 * PULSE) ** 2, left)
    spreads = np.array([0.25, 0.25, 0.5, 5.0 * PULSE, 2.0 * PULSE])
    friction = None
    for signs, misfit in evidence.misfits().items():
        known = np.array([signs[0], signs[1], signs[1], 0.0, 0.0])
        a = np.vstack([x / math.sqrt(variance), np.diag(1.0 / spreads)])
        b = np.append(y / math.sqrt(variance), known / spreads)
        best = np.linalg.lstsq(a, b, rcond=None)[0]
        assert misfit == pytest.approx(0.5 * float(np.sum((b - a @ best) ** 2)), rel=1e-6), signs
        friction = abs(best[3]) + abs(best[4]) if signs == (1.0, 1.0) else friction
    assert evidence.friction() == pytest.approx(friction) and friction == pytest.approx(0.5, abs=0.1)


def test_noise_raises_floors_and_samples_left_out_are_not_fitted():
    rig = noisy_rig()
    evidence = SignEvidence(rig, RATE, PULSE)
    assert evidence.ft_noise == pytest.approx(0.3)
    assert evidence.noise == pytest.approx(math.hypot(J * 2e-3 * math.sqrt(2.0) * RATE, 0.3, 0.4))
    assert SignEvidence(RIG, RATE, PULSE).ft_noise == pytest.approx(1e-3 * PULSE)
    given = stream()
    heard(evidence, *given)
    x, y, _ = rows(*given, creep=8e-3)
    assert evidence._moments[4, 4] == pytest.approx(np.sum(x[:, 4] ** 2))
    assert evidence._floor == pytest.approx(evidence.noise) and y.any()
    none = SignEvidence(RIG, RATE, PULSE)
    heard(none, *given, keep=False)
    assert not none._moments.any() and none.heard == pytest.approx(H * (N - 1))
    assert none.hear(Measurement(math.nan, 0.0, 0.0, 0.0), 0.0, 0) is None
    none.hear(Measurement(1.0, 0.0, 0.0, math.nan), 2.5, 0)
    assert none.made == (given[3][-1], 2.5)
    assert none.hear(Measurement(1.0, 1.0, 0.0, 3.5), 0.0, 2) is None and none.made == (2.5, 3.5)


def test_the_unrest_is_the_rms_about_a_slow_mean():
    given = stream()
    evidence = SignEvidence(RIG, RATE, PULSE)
    heard(evidence, *given)
    mean_ft, speed = (0.5 * (x[1:] + x[:-1]) for x in given[:2])

    def slow(x, seconds):
        a = H / seconds
        return lfilter([a], [1.0, a - 1.0], x, zi=[(1.0 - a) * x[0]])[0]

    square = (mean_ft - slow(mean_ft, 0.3)) ** 2 + (B * speed) ** 2
    assert evidence.unrest == pytest.approx(math.sqrt(slow(square, 0.1)[-1]))


@pytest.mark.parametrize(
    ("factor", "known", "words"),
    [
        (1.0, True, ""),
        (2.0, True, ""),
        (0.6, True, ""),
        (2.4, False, ""),
        (4.0, False, "ft is 0.25 times the torque by motor torque and motion"),
        (0.2, False, "ft is 5 times the torque by motor torque and motion"),
    ],
)
def test_the_size_of_ft_is_its_factor_in_the_balance(factor, known, words):
    given = stream(factor=factor, noise=0.02)
    evidence = SignEvidence(RIG, RATE, PULSE)
    heard(evidence, *given)
    x, y, count = rows(*given)
    motion = x[:, 1] + x[:, 2]
    beside = np.column_stack([x[:, 0], x[:, 3], x[:, 4]])
    best, (left,) = np.linalg.lstsq(beside, y - motion, rcond=None)[:2]
    t, moved = (v - x[:, 3:] @ np.linalg.lstsq(x[:, 3:], v, rcond=None)[0] for v in (x[:, 0], motion))
    least = evidence.noise**2
    noise = 3.0 * math.sqrt(4.0 * max(left / (count - 12.0), least))
    doubt = (noise + 0.5 * math.sqrt(moved @ moved)) / math.sqrt(t @ t)
    assert evidence._size() == pytest.approx((best[0], doubt), rel=1e-6)
    assert best[0] == pytest.approx(factor, abs=0.05)
    evidence.begin_pulse()
    evidence._size = lambda: (factor, 0.15)
    assert evidence.size_is_known() == known
    assert evidence.wrong_size() == words


def pulse(evidence, torque, *, turn=5e-3, feels=None, rest=0.0, samples=50, sign_v=1.0):
    """Play a pulse: the gear turns by `turn`, the motor makes `torque`, ft moves by `feels`."""
    evidence.hear(Measurement(rest, 0.0, 0.0, 0.0), 0.0, 0)
    evidence.hear(Measurement(rest, 0.0, 0.0, 0.0), 0.0, 0)
    evidence._square = 0.0
    evidence.begin_pulse()
    for k in range(samples):
        share = (k + 1) / samples
        ft = rest + (K * turn if feels is None else feels) * share
        evidence.hear(Measurement(ft, sign_v * turn / samples / H, turn * share, torque), 0.0, 0)


@pytest.mark.parametrize(
    ("torque", "feels", "is_felt"),
    [(6.0, 7.5, True), (6.0, -7.5, True), (-6.0, 7.5, True), (0.0, 0.006, True), (0.0, 0.003, False)],
)
def test_a_motor_and_a_load_at_rest_take_no_negative_power(torque, feels, is_felt):
    """SIGNS by s_T, s_w: the motor's power has the sign of s_w, the load's that of both.

    Of the load's 50 parts of a turn of 0.1 mrad noise of 5 mN m says 3 * 3.5 uJ: 4.2 mN m in the end.
    """
    evidence = SignEvidence(RIG, RATE, PULSE)
    pulse(evidence, torque, feels=feels)
    expected = {
        (s_t, s_w): 12.0 * (s_w * torque < 0.0) + 12.0 * (is_felt and s_t * s_w * feels < 0.0)
        for s_t, s_w in SIGNS
    }
    assert evidence.powers() == expected
    evidence.end_pulse()
    evidence._work[:] = 0.0
    assert evidence.powers() == {signs: 0.5 * cost for signs, cost in expected.items()}


def test_a_turn_that_hardly_stretches_the_spring_tells_nothing_of_the_motor():
    for turn, is_told in ((0.99 * 0.1 * PULSE / K, False), (1.01 * 0.1 * PULSE / K, True)):
        evidence = SignEvidence(RIG, RATE, PULSE)
        pulse(evidence, -6.0, turn=turn, feels=0.0)
        assert any(evidence.powers().values()) == is_told
    loaded = SignEvidence(RIG, RATE, PULSE)
    pulse(loaded, -6.0, rest=12.0)  # 0.5 T^2 / K is more than the motor gave
    assert 0.5 * 12.0**2 / K > 6.0 * 5e-3 and loaded.powers()[1.0, 1.0] == 0.0


@pytest.mark.parametrize(
    ("turn", "sign_v", "words"),
    [
        (5e-3, -1.0, "position and velocity of joint_states go opposite ways"),
        (-5e-3, -1.0, "position and velocity of joint_states go opposite ways"),
        (5e-3, 1.0, ""),
        (5e-3, -0.4, ""),
        (0.9 * 0.1 * PULSE / K, -1.0, ""),
    ],
)
def test_position_and_velocity_go_one_way(turn, sign_v, words):
    evidence = SignEvidence(RIG, RATE, PULSE)
    assert evidence.turned() == ""
    pulse(evidence, 6.0, turn=turn, sign_v=sign_v)
    assert evidence.turned() == words


@pytest.mark.parametrize(
    ("way", "most", "size", "words"),
    [
        (1.0, 3.1, 1.0, "joint_states moved by 1 N·m of spring, ft by 3.1 N·m"),
        (1.0, 2.9, 1.0, ""),
        (4.0, 1.5, 1.6, SAID.format(1.5, 4, 0.62)),
        (2.8, 1.5, 1.6, ""),
        (4.0, 1.5, 1.35, ""),
        (1.5, 3.5, 0.6, SAID.format(3.5, 1.5, 1.7)),
        (1.5, 2.8, 0.6, ""),
        (1.5, 3.5, 0.75, ""),
    ],
)  # fmt: skip
def test_spring_and_ft_move_alike_between_clamped_ends(way, most, size, words):
    evidence = SignEvidence(RIG, RATE, PULSE)
    pulse(evidence, 0.0)
    evidence._restless, evidence._strongest = 0.0, 4.0
    evidence.way, evidence.most, evidence._size = way, most, lambda: (size, 0.1)
    assert evidence.wrong_size() == words


@pytest.mark.parametrize(("felt", "told"), [(3.49, False), (3.52, True)])  # of 2.5 · 1.2 + 0.1 PULSE
def test_spring_and_ft_move_no_more_than_the_motor_makes(felt, told):
    evidence = SignEvidence(RIG, RATE, PULSE)
    pulse(evidence, 0.0)
    evidence._restless, evidence._strongest = 0.0, 1.2
    evidence.way, evidence.most, evidence._size = felt, 1.2 * felt, lambda: (1.0, 0.1)
    words = f"ft and K times the gear's angle moved by {felt:.3g} N·m at a motor torque of 1.2"
    assert evidence.wrong_size() == (words if told else "")
    evidence._clamped = False
    assert evidence.wrong_size() == (words if words.startswith("joint") else "")
