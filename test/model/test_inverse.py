"""A measured motion and the torque that it takes, beside the sine and the equation of motion put in."""

import numpy as np
import pytest
from effect_bench import rms
from scipy.integrate import solve_ivp

from rsea_ros.errors import IdentificationError
from rsea_ros.model import inverse
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Record

RIG = load_rig("bare_drive")
T = np.arange(1000) / 100.0
W = 2.0 * np.pi


def channel(values, t=T):
    return Channel(t, np.asarray(values, float))


def sine(t):
    """Return angle, speed and acceleration of half a radian at 1 Hz."""
    return 0.5 * np.sin(W * t), 0.5 * W * np.cos(W * t), -0.5 * W**2 * np.sin(W * t)


def test_a_motion_is_the_angle_its_rates_and_the_torque_of_its_instants():
    record = Record({"position": channel(sine(T)[0]), "command": channel(3.0 * np.cos(W * T)),
                     "motor_torque": channel(2.0 * np.cos(W * T))})  # fmt: skip
    motion = inverse.motion_from(record)
    assert motion.t == pytest.approx(T) and not len(motion.command)
    inside = motion.counts
    assert inside.any() and not inside[0] and not inside[-1]
    margin = T[inside][0]
    assert T[-1] - T[inside][-1] == pytest.approx(margin, abs=0.011) and 0.1 < margin < 2.0
    for given, true in zip((motion.q, motion.v, motion.a), sine(T), strict=True):
        assert given[inside] == pytest.approx(true[inside], abs=5e-3 * np.max(np.abs(true)))
    assert motion.torque[inside] == pytest.approx(2.0 * np.cos(W * T)[inside], abs=0.01)
    asked = inverse.motion_from(Record({n: record[n] for n in ("position", "command")}))
    held = 3.0 * np.cos(W * (T - 0.005))  # the mean of the holds on either side of a stamp
    assert len(asked.command) and asked.torque[inside] == pytest.approx(held[inside], abs=0.02)


def test_a_gap_is_a_line_and_does_not_count_and_what_is_no_number_is_left_out():
    known = (T < 4.0) | (T > 4.8)
    q = sine(T)[0]
    record = Record({"position": channel(q[known], T[known]), "command": channel(np.cos(W * T))})
    motion = inverse.motion_from(record)
    between = (motion.t > 4.0) & (motion.t < 4.8)
    assert not motion.counts[between].any()
    before, after = motion.counts & (motion.t < 4.0), motion.counts & (motion.t > 4.8)
    assert before.any() and after.any()
    assert motion.q[motion.counts] == pytest.approx(sine(motion.t)[0][motion.counts], abs=5e-3)
    line = np.interp(motion.t[between], T[known], q[known])
    assert motion.q[between][2:-2] == pytest.approx(line[2:-2], abs=1e-6)
    assert not motion.v[between][2:-2].any()
    odd = np.where(np.arange(1000) == 300, np.nan, q)
    channels = {"position": odd, "motor_torque": np.full(1000, np.nan), "command": odd}
    spoiled = inverse._finite(Record({n: channel(y) for n, y in channels.items()}))
    assert {n: len(c) for n, c in spoiled.channels.items()} == {"position": 999, "command": 1000}
    with pytest.raises(IdentificationError, match="no position"):
        inverse.motion_from(Record({"command": channel(q)}))
    with pytest.raises(IdentificationError, match="has 9 samples"):
        inverse.motion_from(Record({"position": channel(q[:9], T[:9]), "command": channel(q)}))


def test_spans_lie_between_the_gaps_of_motion_and_torque():
    def at(*gone):
        keep = np.ones(1000, bool)
        for a, b in gone:
            keep &= (a >= T) | (b <= T)
        return channel(T[keep], T[keep])

    record = Record({"position": at((3.0, 3.5)), "motor_torque": at((6.0, 6.5)), "command": at((1.0, 2.0))})
    spans = inverse._sampled_spans(record, 0.0, 9.99)
    assert [x for span in spans for x in span] == pytest.approx([0.0, 3.0, 3.5, 6.0, 6.5, 9.99])
    short = Record({"position": at((3.0, 3.5), (3.7, 4.2))})
    spans = inverse._sampled_spans(short, 0.0, 9.99)
    assert [x for span in spans for x in span] == pytest.approx([0.0, 3.0, 4.2, 9.99])
    assert inverse._sampled_spans(Record({"position": channel(T)}), 0.0, 0.1) == [(0.0, 0.1)]


def test_the_torque_at_an_edge_is_the_mean_of_both_holds():
    command = channel([1.0, 3.0, -5.0, 7.0], np.arange(4.0))
    run = Record({"command": command})
    assert inverse.acting_torque(run) is command
    at = np.array([-0.5, 0.5, 1.0, 1.5, 2.0, 3.5])
    assert inverse._torque_at(run, at) == pytest.approx([1.0, 1.0, 2.0, 3.0, -1.0, 7.0])
    ended = Record({"command": command, "motor_torque": channel([1.1, 3.1, -5.1], np.arange(1.0, 4.0))})
    assert inverse.acting_torque(ended) is ended["motor_torque"]
    assert inverse._torque_at(ended, at[1:5]) == pytest.approx([1.1, 2.1, 3.1, -1.0])
    begun = Record({"command": command, "motor_torque": channel([1.1, 3.1, -5.1, 7.1], np.arange(4.0))})
    assert inverse._torque_at(begun, at[1:4]) == pytest.approx([2.1, 3.1, -1.0])


def test_a_filter_run_both_ways_delays_nothing():
    x = np.sin(W * T)
    assert inverse.smooth(x, 0.01)[200:-200] == pytest.approx(x[200:-200], abs=1e-3)
    assert np.max(np.abs(inverse.smooth(np.sin(2.0 * np.pi * 45.0 * T), 0.01)[200:-200])) < 0.35


def motion(**changes):
    q, v, a = sine(T)
    return inverse.Motion(T, q, v, a, np.zeros(1000), np.ones(1000, bool), **changes)


def taken(rig, **changes):
    return inverse.torques_along(rig, motion(**changes))["motor_torque"][200:-200]


def test_the_torque_of_a_motion_is_that_of_the_equation_of_motion():
    """(J + J_l) q'' + (b + b_l) q' + k_l q + m g l sin(q + q_0), less friction; gains and limits count."""
    q, v, a = (x[200:-200] for x in sine(T))
    values = {"spring_end.inertia": 0.3, "spring_end.damping": 0.2, "spring_end.stiffness": 4.0,
              "spring_end.gravity": 6.0, "spring_end.gravity_angle": 0.4}  # fmt: skip
    rig = RIG.with_values(values)
    inertia = rig["rotor.reflected_inertia"] + rig["chassis.inertia"] + 0.3
    linear = inertia * a + (rig["rotor.reflected_damping"] + 0.2) * v + 4.0 * q
    expected = linear + inverse.smooth(6.0 * np.sin(sine(T)[0] + 0.4), 0.01)[200:-200]
    assert taken(rig) == pytest.approx(expected, abs=1e-6)
    rubbed = taken(rig.with_effects(EffectSetting("coulomb_friction", {"torque": 2.0})))
    assert np.mean((rubbed - expected) * np.sign(v)) == pytest.approx(2.0, rel=0.1)
    weak = rig.with_effects(EffectSetting("torque_constant_error", {"gain": 0.8}))
    assert taken(weak) == pytest.approx(expected / 0.8, abs=1e-6)
    command = W * (np.arange(20_000) + 0.5) * 5e-4
    assert taken(rig, command=command) == pytest.approx(expected, abs=1e-6)
    limited = rig.with_effects(EffectSetting("torque_saturation", {"limit": 2.0}))
    lost = inverse.smooth(np.maximum(W * T - 2.0, 0.0), 0.01)[200:-200]
    assert taken(limited, command=command) == pytest.approx(expected + lost, abs=2e-3)
    with pytest.raises(IdentificationError, match="moving parts, expected one"):
        inverse.torques_along(load_rig("paper_moving_output"), motion())


def test_a_rigid_joint_carries_what_holds_it_from_outside():
    """Its weight and what it stands against, without its inertia: simulated, and along its motion."""
    law = {"motor_coefficient": 0.1, "load_coefficient": 0.2, "quadratic": 0.0, "creep_velocity": 0.03}
    rig = load_rig("pendulum").with_values({"spring_end.stiffness": 0.8, "spring_end.damping": 0.1})
    rig = rig.with_effects(EffectSetting("directional_load_friction", law))
    t = np.arange(1200) / 400.0
    held = 1.5 * np.sin(9.0 * t) + np.sin(23.0 * t)
    inertia, damping = rig["rotor.reflected_inertia"] + 0.15, rig["rotor.reflected_damping"]

    def pendulum(now, x):
        command = held[min(int(now * 400.0 + 1e-9), 1199)]
        load = 3.0 * np.sin(x[0]) + 0.8 * x[0] + 0.1 * x[1]
        friction = abs(0.1 * command + 0.2 * load) * np.tanh(x[1] / 0.03)
        return x[1], (command - load - damping * x[1] - friction) / inertia

    true = solve_ivp(pendulum, (0.0, 3.0), (0.0, 0.0), t_eval=t + 1 / 400.0, max_step=5e-4, rtol=1e-8)
    record = Record({"command": Channel(t, held), "position": Channel(t + 1 / 400.0, true.y[0])}, "true")
    simulated = simulate(rig, record)["position"]
    bare = simulate(rig.with_effects(), record)["position"]
    assert rms(simulated - true.y[0]) < 2e-3 * rms(bare - true.y[0])
    along = inverse.motion_from(record)
    left, lost = (
        (inverse.torques_along(r, along)["motor_torque"] - along.judged["motor_torque"])[200:-200]
        for r in (rig, rig.with_effects())
    )
    assert rms(left) < 0.2 * rms(lost)
