"""Waves, lines and splines that a law may have, found in signals that have them."""

from types import SimpleNamespace as Of

import numpy as np
import pytest
from scipy.interpolate import BSpline

from rsea_ros.laws.candidates import (
    SPLINES,
    basis_of,
    factor_of,
    frequencies,
    periods,
    spline_knots,
    terms_for,
)

T = np.arange(40_000) / 280.0


def travelled(turns):
    """Return angles of a rotor that swings over so many turns, slowly."""
    return np.pi * turns * (1.0 - np.cos(2.0 * np.pi * T / 40.0)) + 3.0


@pytest.mark.parametrize("cycles", [1.0, 4.0, 12.5])
def test_the_waves_over_an_angle_are_found_whatever_follows_time(cycles):
    theta, noise = travelled(9.0), np.random.default_rng(2).standard_normal(len(T))
    torque = np.sin(cycles * theta + 0.4) + 0.2 * theta + np.sin(3.0 * T) + 0.3 * noise
    found = periods(theta, torque)
    assert found[0] == pytest.approx(cycles, abs=0.03) and len(found) <= 2
    two = periods(theta, torque + 0.7 * np.sin(3.0 * cycles * theta))
    assert two == pytest.approx([cycles, 3.0 * cycles], abs=0.03)
    assert all(f > 2.4 / 9.0 for f in periods(theta, np.sin(theta / 9.0))), "too few turns to repeat"
    assert periods(np.ones(len(T)), torque) == []


def test_a_wave_that_multiplies_another_signal_is_found_over_that():
    theta = travelled(9.0)
    deflection = np.cos(2.2 * theta)
    torque = deflection * np.sin(6.0 * theta)
    assert periods(theta, torque, deflection)[0] == pytest.approx(6.0, abs=0.05)
    assert periods(theta, torque)[0] != pytest.approx(6.0, abs=0.05), "as a torque it has others"
    assert periods(theta, torque, 0.0 * deflection) == []


def test_waves_are_tried_where_the_torque_repeats_or_the_torque_over_the_deflection():
    theta, step = travelled(9.0), T[1]
    letters = {"t": T, "theta": theta, "d": np.cos(2.2 * theta)}
    acting = {"gear": np.sin(4.0 * theta), "spring": letters["d"] * np.sin(6.0 * theta)}
    for place, cycles in (("gear", 4.0), ("spring", 6.0)):
        missing = Of(t=T + 0.5 * step, torque=acting[place])
        model = Of(variables=Of(letters=letters, step=step), missing=missing, injector=1, places={place})
        waves = [t.shapes[0] for t in terms_for([model]) if "periodic" in t.regressor]
        assert waves[:2] == pytest.approx([cycles] * 2, abs=0.05), "a sine and a cosine"


def test_the_lines_of_a_residual_lie_between_a_hertz_and_most_of_the_band():
    residual = (
        np.sin(2.0 * np.pi * 50.0 * T)
        + 3.0 * np.sin(2.0 * np.pi * 0.9 * T)
        + 0.5 * np.sin(2.0 * np.pi * 17.0 * T)
    )
    residual += 5.0 * np.sin(2.0 * np.pi * 130.0 * T)
    assert frequencies(T, residual, len(T), apart=8) == pytest.approx([50.0, 17.0], abs=0.01)


def case(**letters):
    return Of(variables=Of(letters=letters))


@pytest.mark.parametrize("spline", SPLINES, ids=lambda s: f"{s.place}-{s.regressor}")
def test_the_parts_of_a_spline_add_up_to_one(spline):
    x = np.random.default_rng(1).standard_normal(5000)
    knots = spline_knots([case(**{spline.over: x[:3000]}), case(**{spline.over: x[3000:]})], spline)
    low, high = np.quantile(x, [0.001, 0.999])
    assert knots[[0, -1]] == pytest.approx([low, high]) and len(knots) == spline.parts + 3
    parts = basis_of(x, knots)
    assert parts.shape == (spline.parts, 5000) and parts.sum(axis=0) == pytest.approx(1.0)
    inside = np.clip(x, low, high)
    truth = BSpline(knots, np.arange(spline.parts, dtype=float), 2)(inside)
    np.testing.assert_allclose(np.arange(spline.parts) @ parts, truth, atol=1e-9)
    middle = spline.parts - 1
    halfway = 0.5 * (np.linspace(low, high, middle) + np.quantile(x, np.linspace(0.001, 0.999, middle)))
    np.testing.assert_allclose(knots[2:-2], halfway, atol=1e-6)


@pytest.mark.parametrize(
    ("place", "over", "factor", "expected"),
    [("gear", "w", "", 1.0), ("gear", "w", "T", [2.0, 3.0]), ("ft", "t", "T", [-2.0, 3.0]),
     ("gear", "t", "w", [-0.001, 5.0]), ("gear", "q", "w", [-np.tanh(0.5), 1.0]),
     ("motor", "w", "u", [1.0, -4.0]),
     ("gear", "w", "u", [1.0, 4.0])],
)  # fmt: skip
def test_loads_act_on_friction_by_their_size(place, over, factor, expected):
    letters = {"T": np.array([-2.0, 3.0]), "w": np.array([-0.001, 5.0]), "u": np.array([1.0, -4.0])}
    assert factor_of(Of(letters=letters), place, over, factor) == pytest.approx(expected)
