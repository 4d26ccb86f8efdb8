"""The general law of Bouc and Wen against a general integrator; Dahl's is a special case of it."""

from __future__ import annotations

import numpy as np
import pytest
import slow_equations
from effect_bench import RIG, SIGNALS, command, record_of, rms, simulate
from scipy.integrate import solve_ivp

from rsea_ros.effects.spring_hysteresis import along, reach
from rsea_ros.model.drive import drive_from

TOLERANCE = {"ft": 6e-3, "position": 1.5e-6, "velocity": 8e-5}
"""A fifth to two fifths of the sensors' noise."""
GAMMAS = (-1.711, -1.5, -0.4, 0.3, 0.5, 0.9)
"""Hardening as in the Bouc-Wen benchmark, straight loading, faster and slower unloading, straight."""


def beta_of(gamma: float) -> float:
    """Return beta of the law's scale."""
    return (1.0 if gamma >= -0.5 else 1.0 - (gamma + 0.5) ** 2) - gamma


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("z", [-0.9, -0.2, 0.0, 0.7])
def test_motion_in_one_direction_is_exact(gamma: float, z: float):
    beta, way = beta_of(gamma), 1.7

    def law(u, y):
        return [1.0 - (beta * np.sign(y[0]) + gamma) * abs(y[0]), y[0]]

    true = solve_ivp(law, (0.0, way), [z, 0.0], rtol=1e-10, atol=1e-12, max_step=1e-3).y[:, -1]
    np.testing.assert_allclose(along(z, way, gamma), true, rtol=1e-6, atol=1e-7)


def test_the_series_meets_the_exponential():
    for rate in (-1.0, 1.0):
        below, above = (np.array(reach(rate, u)) for u in (0.00999999, 0.01000001))
        np.testing.assert_allclose(below, above, rtol=1e-5)


@pytest.mark.parametrize("gamma", GAMMAS[::2])
def test_the_simulation_obeys_the_law(gamma: float, monkeypatch: pytest.MonkeyPatch):
    p = {"torque": 2.0, "angle": 4e-3, "gamma": gamma}
    beta = beta_of(gamma)

    def law(t, x, u, p):
        w, a, torque = slow_equations.motion(x[:2], u, spring=p["torque"] * x[2])
        rate = w - (beta * abs(w) * x[2] + gamma * w * abs(x[2]))
        return [w, a, rate / p["angle"]], torque

    monkeypatch.setitem(slow_equations.LAWS, "spring_hysteresis", (3, law))
    commanded = command(rate=280.0, duration=1.0)
    simulated = simulate(drive_from(record_of(commanded)), "spring_hysteresis", p)
    true = slow_equations.solve("spring_hysteresis", p, commanded.y, commanded.t[1])
    for name in SIGNALS:
        assert rms(simulated[name] - true[name]) < TOLERANCE[name], name


def test_the_law_without_a_shape_parameter_is_dahls():
    driven = drive_from(record_of(command(280.0, 2.0)))
    short, full = (
        simulate(driven, "spring_hysteresis", {"torque": 1.0, "angle": 2e-3, **more})
        for more in ({}, {"gamma": 0.0})
    )
    for name in SIGNALS:
        np.testing.assert_array_equal(short[name], full[name])
    straight = simulate(driven, "spring_hysteresis", {"torque": 1.0, "angle": 2e-3, "gamma": 0.5})
    assert rms(straight["ft"] - short["ft"]) > 0.03
    assert RIG.with_effect("spring_hysteresis").effects[0].parameters["gamma"] == 0.0
