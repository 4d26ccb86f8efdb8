"""What is learned while the bench runs equals regressions over the whole past, and what is put in."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from rsea_ros.control.learning import LOCKED, Learning, Stretch, Yielding, _within

H, K, B = 1.0 / 280.0, 1500.0, 2.0
J, DAMPING = 0.9, 4.0
T = H * np.arange(1500)


def learning():
    rig = {"spring.stiffness": K, "spring.damping": B}
    return Learning(rig, SimpleNamespace(period=H, inertia=J, damping=DAMPING))


def wave(*hz, phase=0.0):
    return sum(np.sin(2.0 * np.pi * f * T + phase + k) for k, f in enumerate(hz))


def test_a_spring_stretches_as_its_equation_says():
    """B phi' + K phi = T, integrated with a thousand steps to a sample."""
    spring = Stretch(K, B, H)
    spring.start(30.0)
    phi, before, fine = 30.0 / K, 30.0, 1000
    for torque in (30.0, 45.0, -20.0):
        at_begin = phi
        for k in range(fine):
            now = before + (torque - before) * (k + 0.5) / fine
            phi += (now - K * phi) / B * H / fine
        assert spring.rate(torque) == pytest.approx((phi - at_begin) / H, rel=2e-3, abs=1e-6)
        before = torque
    stiff = Stretch(K, 0.0, H)
    assert stiff.rate(30.0) == pytest.approx(30.0 / K / H)
    assert stiff.rate(30.0) == 0.0


def parts_of(mean):
    """Return s T / (s + w)^2 and w s T / (s + w)^3, w of 1.5 Hz, of a torque that is held in each sample."""
    w = 3.0 * math.pi
    held = [cont2discrete((n, np.poly([-w] * order)), H)[:2] for n, order in (([1.0, 0.0], 2), ([w, 0.0], 3))]
    return np.array([lfilter(top.ravel(), bottom, np.append(mean, 0.0))[1:] for top, bottom in held])


def test_what_follows_the_load_is_that_of_its_transfer_functions():
    torque, yielding = wave(2.0, 7.0), Yielding(H)
    expected = parts_of(torque)
    for k, u in enumerate(torque[:400]):
        assert yielding.after(u) == pytest.approx(expected[:, k], abs=1e-9)
        assert yielding.advance(u) == pytest.approx(expected[:, k], abs=1e-9)
    yielding.start(12.0)
    assert yielding.advance(12.0) == pytest.approx([0.0, 0.0], abs=1e-9)


def signals(theta, drive, acting, gap=0.0):
    """Return ft, velocity, torque and acted of a bench that keeps to the equations."""
    ft = 20.0 * wave(5.0, 9.0)
    mean = 0.5 * (ft + np.append(0.0, ft[:-1]))
    parts = parts_of(mean)
    halves = 0.5 * (parts + np.column_stack([np.zeros(2), parts[:, :-1]]))
    spring = Stretch(K, B, H)
    stretch = np.array([spring.rate(f) for f in ft])
    speed = np.array(theta) @ [stretch, *halves] + gap
    velocity = np.zeros(len(T) + 1)
    for k, mean_speed in enumerate(speed):
        velocity[k + 1] = 2.0 * mean_speed - velocity[k]
    rows = np.array([np.diff(velocity) / H, speed, np.tanh(speed / 5e-3)])
    return ft, velocity[1:], np.array(drive) @ rows + mean, np.array(acting) @ rows + mean, (
        np.array([stretch, *halves, speed - gap]), rows)  # fmt: skip


def passed(row):
    """Return a signal through two low passes of 25 Hz and two high passes of 4 Hz."""
    for hz, is_high in ((25.0, False), (25.0, False), (4.0, True), (4.0, True)):
        pole = math.exp(-2.0 * math.pi * hz * H)
        low = lfilter([1.0 - pole], [1.0, -pole], row)
        row = row - low if is_high else low
    return row


def regression(rows, y, known, spreads, floor, until):
    """Return the fit of all samples up to one, older ones weighted down over 0.5 s, beside the rig's."""
    weight = np.sqrt((1.0 - math.exp(-H / 0.5)) * np.exp(-H / 0.5 * np.arange(until)[::-1]))
    x, y = np.array([passed(r)[:until] for r in rows]).T * weight[:, None], passed(y)[:until] * weight
    prior = floor / math.sqrt(20.0) / np.array(spreads)
    return np.linalg.lstsq(np.vstack([x, np.diag(prior)]), np.append(y, prior * known), rcond=None)[0]


def test_load_drive_and_torque_that_acted_are_regressions_with_forgetting_over_the_past():
    theta, drive, acting = (1.05, 2.0, 0.3), (1.0, 5.0, 0.8), (0.8, 3.5, 1.5)
    ft, velocity, torque, acted, (load_rows, rows) = signals(theta, drive, acting, gap=0.02)
    learns = learning()
    for k in range(len(T)):
        learns.hear(ft[k], velocity[k], torque[k], acted[k], gap=0.02)
    # from the first sample that moves on each fourth is solved for the load, two later for the drive
    assert learns.load == pytest.approx(theta, rel=2e-2)
    assert learns.drive == pytest.approx(drive, rel=5e-2)
    assert learns.acting == pytest.approx(acting, rel=5e-2)
    mean = 0.5 * (ft + np.append(0.0, ft[:-1]))
    spreads, known = (0.2 * J, 0.6 * DAMPING, 5.0), np.array([J, DAMPING, 0.0])
    ends = range(len(T) - 3, len(T) + 1)
    loads = [regression(load_rows[:3], load_rows[3], LOCKED, (0.15, 20, 20), 4e-3, n) for n in ends]
    assert min(np.abs(learns.load - x).max() for x in loads) < 1e-4
    for learned, y in ((learns.drive, torque - mean), (learns.acting, acted - mean)):
        fits = [regression(rows, y, known, spreads, 0.1, n) for n in ends]
        assert min(np.abs(learned - x).max() for x in fits) < 1e-4


def test_a_torque_that_acted_as_commanded_is_learned_once_and_an_unsure_one_never():
    ft, velocity, torque, _, _ = signals((1.0, 0.0, 0.0), (1.0, 5.0, 0.8), (1.0, 5.0, 0.8))
    same, unsure, still = learning(), learning(), learning()
    for k in range(400):
        same.hear(ft[k], velocity[k], torque[k], torque[k])
        unsure.hear(ft[k], velocity[k], torque[k], torque[k], sure=False)
        still.hear(1e-3 * ft[k], 1e-3 * velocity[k], torque[k], torque[k])
    assert same.acting is same.drive and same.drive[0] != J
    for nothing in (unsure, still):
        assert nothing.load is LOCKED and nothing.drive.tolist() == [J, DAMPING, 0.0]


def test_a_load_that_stops_is_forgotten():
    ft, velocity, torque, acted, _ = signals((1.0, 2.0, 0.0), (J, DAMPING, 0.0), (J, DAMPING, 0.0))
    spring, learns = Stretch(K, B, H), learning()
    for k in range(700):
        learns.hear(ft[k], velocity[k], torque[k], acted[k])
        spring.rate(ft[k])
    assert learns.load[1] == pytest.approx(2.0, rel=0.05)
    speed = velocity[699]
    was = []
    for k in range(700, 700 + round(0.3 / H)):
        speed = 2.0 * spring.rate(ft[k]) - speed  # the spring alone moves
        learns.hear(ft[k], speed, torque[k], acted[k])
        was.append(learns.load[1])
    forgotten = np.flatnonzero(np.array(was) < 0.2)
    assert 0.02 < H * forgotten[0] < 0.06 and max(was[forgotten[0] :]) < 1.0  # filters hold the old load
    assert max(was[round(0.2 / H) :]) < 0.2


def test_a_pendulum_near_its_own_frequency_has_a_negative_part_nothing_else_has():
    swinging, locked = learning(), learning()
    for learns, theta in ((swinging, (1.0, -8.0, 20.0)), (locked, (1.0, -1.0, 1.0))):
        ft, velocity, torque, acted, _ = signals(theta, (J, DAMPING, 0.0), (J, DAMPING, 0.0))
        for k in range(600):
            learns.hear(ft[k], velocity[k], torque[k], acted[k])
    assert swinging.load == pytest.approx([1.0, -8.0, 20.0], rel=0.03)
    assert locked.load[1] == 0.0


@pytest.mark.parametrize(
    ("right", "solution"),
    [
        ([1.0, 1.0], [1.0 / 3.0, 1.0 / 3.0]),
        ([9.0, 0.0], [2.0, -1.0]),
        ([9.0, 4.0], [2.0, 1.0]),
        ([-9.0, 9.0], [-2.0, 3.0]),
    ],
)
def test_what_exceeds_its_bound_is_set_to_it_and_the_rest_is_solved_anew(right, solution):
    matrix = np.array([[2.0, 1.0], [1.0, 2.0]])
    inside = _within(matrix, np.array(right), np.array([-2.0, -3.0]), np.array([2.0, 3.0]))
    assert inside == pytest.approx(solution)
