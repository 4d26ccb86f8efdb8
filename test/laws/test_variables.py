"""The memories of a law are the solutions of their equations, by scipy or written out."""

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

from rsea_ros.laws.variables import RING, from_ring, remember

STEP = 5e-4
T = np.arange(400) * STEP
VALUES = np.sin(2.0 * np.pi * 7.0 * T) + 0.3 * np.cos(2.0 * np.pi * 31.0 * T) - 0.2


def held(numerator, denominator, values, begin):
    """Return what a filter that rests at `begin` makes of values that are held, each at its end."""
    b, a, _ = signal.cont2discrete((numerator, denominator), STEP)
    late = np.concatenate([values - begin, [values[-1] - begin]])
    return begin + signal.lfilter(b[0], a, late)[1:]


@pytest.mark.parametrize(("frequency", "ratio"), [(20.0, 0.05), (80.0, 0.7)])
def test_a_mode_rings_as_its_equation_does(frequency, ratio):
    w = 2.0 * np.pi * frequency
    expected = held([w * w], [1.0, 2.0 * ratio * w, w * w], VALUES, VALUES[0])
    np.testing.assert_allclose(remember("ring", VALUES, STEP, frequency, ratio), expected, atol=1e-9)


@pytest.mark.parametrize("memory", ["lag", "heat"])
def test_a_lag_begins_at_nothing_and_heat_is_that_of_the_square(memory):
    values = VALUES**2 if memory == "heat" else VALUES
    expected = held([1.0], [0.01, 1.0], values, 0.0)
    np.testing.assert_allclose(remember(memory, VALUES, STEP, 0.01), expected, atol=1e-12)


def test_play_is_dragged_at_its_edges():
    values = np.array([0.0, 0.5, 1.5, 1.2, -0.4, -0.6, -2.0, 3.0])
    assert remember("play", values, STEP, 1.0) == pytest.approx([0.0, 0.0, 0.5, 0.5, 0.5, 0.4, -1.0, 2.0])


def test_a_bristle_obeys_dahls_equation():
    """z' = (1 - sign(way) z) / angle, along each way, integrated by scipy."""
    angle, z, expected = 0.15, 0.0, [0.0]
    for way in np.diff(VALUES[:60]):
        side = np.sign(way)
        end = solve_ivp(lambda _, z: (side - z) / angle, (0.0, abs(way)), [z], rtol=1e-10, atol=1e-12)  # noqa: B023
        z = float(end.y[0, -1])
        expected.append(z)
    np.testing.assert_allclose(remember("dahl", VALUES[:60], STEP, angle), expected, atol=1e-7)


@pytest.mark.parametrize("steps", [0.0, 1.0, 7.25, 40.5])
def test_a_delay_along_a_signal_is_the_one_in_the_ring(steps):
    """Nothing was there before the first value; between values lies a line."""
    late = remember("delay", VALUES, STEP, steps * STEP)
    before = np.concatenate([np.zeros(60), VALUES])
    at = np.arange(len(VALUES)) + 60 - steps
    whole, part = np.floor(at).astype(int), at - np.floor(at)
    expected = (1.0 - part) * before[whole] + part * np.concatenate([before, [0.0]])[whole + 1]
    np.testing.assert_allclose(late, expected, atol=1e-12)
    ring = np.zeros(3 + RING)
    python = from_ring.py_func if hasattr(from_ring, "py_func") else from_ring
    np.testing.assert_allclose([python(ring, 2, v, steps) for v in VALUES], expected, atol=1e-12)
    assert not ring[:2].any()


def test_a_ring_keeps_no_more_than_it_holds():
    python = from_ring.py_func if hasattr(from_ring, "py_func") else from_ring
    ring = np.zeros(1 + RING)
    out = [python(ring, 0, float(k), 1e9) for k in range(1200)]
    assert out[1199] == 1199.0 - (RING - 2.0)
    assert python(np.zeros(1 + RING), 0, 5.0, -3.0) == 5.0
