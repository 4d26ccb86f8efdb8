"""The laws that effects compile, over one step, against scipy's integrals and polynomials."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import BarycentricInterpolator, CubicHermiteSpline
from scipy.linalg import expm

from rsea_ros.effects import _chassis, _friction, _time, spring_hysteresis as hysteresis
from rsea_ros.effects.signal_table import CREEP, GEAR_VELOCITY, GEAR_VELOCITY_SPAN, MOBILITY

PATHS = [(0.0, 0.4), (0.6, 0.9), (-0.5, 0.2), (-0.5, 3.0), (0.0, 5e-3), (-0.9, 1.7)]


@pytest.mark.parametrize(("z", "u"), PATHS)
@pytest.mark.parametrize("gamma", [0.0, 0.5, 0.9, -0.4, -1.0, -1.711])
def test_hysteresis_is_bouc_wens_equation_along_a_way(z, u, gamma):
    """dz/du = 1 - (beta sign(z) + gamma) |z|; what unloads more softly than it loads hardens."""
    over = 1.0 - min(gamma + 0.5, 0.0) ** 2

    def slope(_, x):
        rate = over if x[0] >= 0.0 else over - 2.0 * gamma
        return [1.0 - rate * x[0], x[0]]

    truth = solve_ivp(slope, (0.0, u), [z, 0.0], rtol=1e-10, atol=1e-12, max_step=u / 50)
    assert hysteresis.along.py_func(z, u, gamma) == pytest.approx(tuple(truth.y[:, -1]), abs=1e-6)


@pytest.mark.parametrize("a", [0.0, 1e-4, 0.009, 0.011, 1.0, -2.0])
def test_the_gain_of_a_way_and_its_integral(a):
    gain = quad(lambda v: math.exp(-a * v), 0.0, 1.0)[0]
    area = quad(lambda w: quad(lambda v: math.exp(-a * v), 0.0, w)[0], 0.0, 1.0)[0]
    assert hysteresis.reach.py_func(a, 1.0) == pytest.approx((gain, area), rel=1e-9)


@pytest.mark.parametrize("steps", [0.0, 0.3, 0.999, 1.0, 1.25, 7.8, 500.5])
def test_an_older_reading_lies_on_the_cubic_through_its_neighbours(steps):
    """In the last step the parabola; before the first reading there was the same."""
    ring, values = np.zeros(3 + _time.RING), 2.0 + np.sin(np.arange(1600) / 5.0)
    out = [_time.older.py_func(ring, 3, v, steps) for v in values]
    for k in (1599, 1100):
        at, whole = k - steps, int(steps)
        near = np.arange(k - whole - 2, k - whole + (2 if whole else 1))
        assert out[k] == pytest.approx(float(BarycentricInterpolator(near, values[near])(at)), abs=1e-9)
    assert out[0] == pytest.approx(2.0) and not ring[:3].any()


def test_a_ring_keeps_a_thousand_steps_and_a_drift_ends_at_one():
    ring = np.zeros(_time.RING)
    out = [_time.older.py_func(ring, 0, float(k), 1e9) for k in range(3000)]
    assert out[2999] == pytest.approx(2999.0 - (_time.LENGTH - 3.0))
    for constant in (0.5, 3.0):
        whole = 1.0 - math.exp(-10.0 / constant)
        part = _time.progress.py_func(2.0, 10.0, constant)
        assert part == pytest.approx((1.0 - math.exp(-2.0 / constant)) / whole)
    assert _time.progress.py_func(2.0, 10.0, 2e9) == 0.2


@pytest.mark.parametrize(("a", "b"), [(0.3, 1.7), (-2.0, 0.5), (5.0, -40.0), (0.4, 0.4005), (-9.0, -9.0)])
def test_the_mean_of_tanh_over_a_path_and_its_slope(a, b):
    mean, slope = _friction.mean_tanh.py_func(a, b, math.exp(-2.0 * abs(a)))

    def truth(end):
        return quad(math.tanh, a, end, points=[0.0])[0] / (end - a) if end != a else math.tanh(a)

    assert mean == pytest.approx(truth(b), abs=1e-6)
    assert slope == pytest.approx((truth(b + 1e-3) - truth(b - 1e-3)) / 2e-3, abs=1e-3)


@pytest.mark.parametrize(
    ("start", "free", "gain"),
    [
        (0.5, 1.0, 0.3), (0.5, 1.0, 30.0), (-4.0, 3.0, 10.0), (8.0, -6.0, 2.0), (2.0, 2.0, 1e4),
        (0.0, 50.0, 1.0),
        # Newton's method swung from one side of rest to the other for all of its 40 steps
        (-2.416, 18.95, 30.0), (2.409, -19.98, 30.0), (0.696, -21.42, 30.0), (0.5, 2e4, 3e4),
        (1e-3, 40.0, 1e6),
    ],
)  # fmt: skip
def test_friction_brakes_a_step_by_the_mean_that_it_has_itself(start, free, gain):
    mean = _friction._implicit_mean.py_func(start, free, gain)
    end = free - gain * mean
    assert -1.0 <= mean <= 1.0
    truth = quad(math.tanh, start, end, points=[0.0])[0] / (end - start)
    assert mean == pytest.approx(truth, abs=2e-3 / max(gain, 1.0) + 1e-6)
    along = _friction.mean_tanh.py_func(start, end, math.exp(-2.0 * abs(start)))[0]
    assert along == pytest.approx(mean, abs=2e-6)


def friction(start, predicted, size, mobility, creep, *more):
    s = np.zeros(64)
    s[GEAR_VELOCITY], s[GEAR_VELOCITY_SPAN] = 0.5 * (start + predicted), predicted - start
    s[MOBILITY], s[CREEP] = mobility, creep
    return _friction.mean_friction.py_func(s, size, 0.0, 0.01, *more)


@pytest.mark.parametrize(
    ("start", "predicted", "size", "mobility"),
    [(0.5, 0.6, 3.0, 1e-3), (-0.5, -0.6, 3.0, 1e-3), (0.02, 0.03, 2.0, 1e-3), (0.05, -0.04, 2.0, 1e-3),
     (0.2, 0.13, 1.0, 0.01)],
)  # fmt: skip
def test_the_mean_friction_of_a_step_is_that_of_the_motion_it_brakes(start, predicted, size, mobility):
    """Over the step, w' = free rate - mobility size tanh(w / w_c); creep replaces w_c."""
    for creep, width in ((0.0, 0.01), (0.03, 0.03)):
        free = predicted - start
        truth = solve_ivp(
            lambda _, x: [free - mobility * size * math.tanh(x[0] / width), size * math.tanh(x[0] / width)],  # noqa: B023
            (0.0, 1.0), [start, 0.0], rtol=1e-9, atol=1e-12,
        ).y[1, -1]  # fmt: skip
        assert friction(start, predicted, size, mobility, creep) == pytest.approx(truth, abs=0.03 * size)


@pytest.mark.parametrize(
    ("start", "predicted"), [(0.3, 0.31), (0.12, 0.06), (0.08, -0.05), (-0.03, 0.09), (0.06, 0.02)]
)
def test_friction_that_fades_with_speed_is_that_of_the_whole_motion(start, predicted):
    """Taken at one speed of the step it was off by half of itself where the step crosses what fades."""
    size, more, fades, mobility = 1.5, 2.0, 0.05, 0.01

    def moved(_, x):
        torque = (size + more * math.exp(-((x[0] / fades) ** 2))) * math.tanh(x[0] / 0.01)
        return [predicted - start - mobility * torque, torque]

    truth = solve_ivp(moved, (0.0, 1.0), [start, 0.0], rtol=1e-9, atol=1e-12).y[1, -1]
    mean = friction(start, predicted, size, mobility, 0.0, more, fades)
    assert mean == pytest.approx(truth, abs=0.02 * more)


CHASSIS = _chassis.SprungChassis(1500.0, 3.0, 0.004)
STIFF = _chassis.SprungChassis(1500.0, 30.0, 0.004)


@pytest.mark.parametrize("chassis", [CHASSIS, STIFF])
def test_a_free_chassis_swings_as_its_equation(chassis):
    k, b, j = chassis
    truth = expm(np.array([[0.0, 1.0], [-k / j, -b / j]]) * 2e-3) @ [0.01, -0.5]
    assert _chassis.swing.py_func(0.01, -0.5, 2e-3, chassis) == pytest.approx(tuple(truth), rel=1e-9)


PATH = _chassis.GearPath(0.010, 0.5, 0.013, -1.0, 2e-3)


@pytest.mark.parametrize("t", [0.0, 7e-4, 2e-3])
def test_a_gear_goes_along_the_cubic_through_both_ends(t):
    cubic = CubicHermiteSpline([0.0, PATH.h], [PATH.d_0, PATH.d_1], [PATH.w_0, PATH.w_1])
    truth = float(cubic(t)), float(cubic(t, 1)), float(cubic.integrate(0.0, t))
    assert _chassis.along.py_func(PATH, t) == pytest.approx(truth, rel=1e-9, abs=1e-15)


def played(y, v, half, path, chassis, count=1_000):
    """Return the chassis at the end of a step, and its integral, by small steps of its equation."""
    k, b, j = chassis
    dt, area = path.h / count, 0.0
    cubic = CubicHermiteSpline([0.0, path.h], [path.d_0, path.d_1], [path.w_0, path.w_1])
    t = np.arange(count + 1) * dt
    angle, speed = cubic(t), cubic(t, 1)
    for i in range(count):
        v += dt * (-k * y - b * v) / j
        new = y + dt * v
        off = angle[i + 1] - new
        if abs(off) > half:
            new = angle[i + 1] - math.copysign(half, off)
            v = speed[i + 1]
        area += 0.5 * dt * (y + new)
        y = new
    return y, v, area


@pytest.mark.parametrize(
    ("y", "v", "side", "path"),
    [
        (0.008, 0.5, 1.0, PATH),
        (0.0105, 1.0, 0.0, PATH),
        (0.012, -9.0, -1.0, PATH),
        (0.0, 0.0, 0.0, _chassis.GearPath(0.001, 1.0, 0.0035, 1.4, 2e-3)),
        (0.0, 0.0, 0.0, _chassis.GearPath(-0.001, -1.0, -0.0035, -1.4, 2e-3)),
        (0.010, 2.0, 1.0, _chassis.GearPath(0.012, 2.0, 0.0145, 0.2, 2e-3)),
        (-0.010, -2.0, -1.0, _chassis.GearPath(-0.012, -2.0, -0.0145, -0.2, 2e-3)),
    ],
)
def test_a_chassis_between_two_flanks_goes_as_small_steps_of_its_equation(y, v, side, path):
    if side:
        y = path.d_0 - side * 0.002
        v = path.w_0
    end, speed, _, area = _chassis.over_step.py_func(y, v, side, 0.002, path, CHASSIS)
    truth = played(y, v, 0.002, path, CHASSIS)
    assert (end, area / path.h) == pytest.approx((truth[0], truth[2] / path.h), abs=2e-5)
    assert speed == pytest.approx(truth[1], abs=0.05)
