"""Optional parameters, which are zero at the typical sizes, against the general integrator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import slow_equations
from effect_bench import RIG, SIGNALS, command, drive, record_of, rms, simulate
from slow_equations import B_M, B_S, DURATION, K_S, J, motion

from rsea_ros.errors import ParameterError
from rsea_ros.model.drive import drive_from

TOLERANCE = {"ft": 6e-3, "position": 1.5e-6, "velocity": 8e-5}
"""A fifth to two fifths of the sensors' noise."""
MASS, DAMPING, HEAVY = 0.5, 0.4, 6.0


def settled_part(t, p):
    """Return the part of a drift that is reached at t."""
    return math.expm1(-t / p["time_constant"]) / math.expm1(-DURATION / p["time_constant"])


def settling_sensor(t, x, u, p):
    w, a, torque = motion(x, u)
    return [w, a], torque + p["drift"] * settled_part(t, p)


def warming_motor(t, x, u, p):
    w, a, torque = motion(x, (1 + p["relative_change"] * settled_part(t, p)) * u)
    return [w, a], torque


def sensor_under_the_base(t, x, u, p):
    q, w, y, v = x
    torque = K_S * (q - y) + B_S * (w - v)
    held = p["stiffness"] * y + 2 * p["damping_ratio"] * math.sqrt(p["stiffness"] * p["inertia"]) * v
    pull = (torque - held) / p["inertia"]
    return [w, (u - B_M * w - torque) / J, v, pull], torque - p["above_sensor"] * p["inertia"] * pull


def dead_band(t, x, u, p):
    ramp = min(max((abs(u) - p["width"]) / (0.001 * p["width"]) + 0.5, 0.0), 1.0)
    begun = max(abs(u) - p["width"], 0.0) + p["jump"] * p["width"] * ramp
    w, a, torque = motion(x, math.copysign(begun, u))
    return [w, a], torque


def payload(t, x, u, p):
    q, w, y, v = x
    torque = K_S * (q - y) + B_S * (w - v)
    fall = (torque - DAMPING * v - (HEAVY + p["torque"]) * math.sin(y)) / MASS
    return [w, (u - B_M * w - torque) / J, v, fall], torque


VARIANTS = {
    "ft_drift": (2, settling_sensor, {"drift": 2.0, "time_constant": 0.4}),
    "torque_constant_drift": (2, warming_motor, {"relative_change": -0.2, "time_constant": 0.5}),
    "base_compliance": (
        4,
        sensor_under_the_base,
        {"stiffness": 3e4, "inertia": 0.5, "damping_ratio": 0.02, "above_sensor": 0.7},
    ),
    "dead_zone": (2, dead_band, {"width": 4.0, "jump": 1.0}),
    "directional_load_friction": (
        2,
        slow_equations.LAWS["directional_load_friction"][1],
        {"motor_coefficient": 0.1, "load_coefficient": 0.02, "quadratic": 0.01, "creep_velocity": 2e-3},
    ),
    "gravity_error": (4, payload, {"torque": -4.0}),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_simulation_obeys_the_whole_equation(name: str, monkeypatch: pytest.MonkeyPatch):
    states, law, p = VARIANTS[name]
    monkeypatch.setitem(slow_equations.LAWS, name, (states, law))
    rig, commanded = (pendulum_rig() if name == "gravity_error" else RIG), command(280.0, DURATION)
    simulated = simulate(drive_from(record_of(commanded)), name, p, rig)
    true = slow_equations.solve(name, p, commanded.y, commanded.t[1])
    for signal in SIGNALS:
        assert rms(simulated[signal] - true[signal]) < TOLERANCE[signal], signal


def pendulum_rig():
    """Return the bench with its spring's end free, a pendulum on it."""
    values = {"spring_end.inertia": MASS, "spring_end.damping": DAMPING, "spring_end.gravity": HEAVY}
    return replace(RIG.with_values(values), clamped=frozenset({"housing_end"}))


def test_an_unknown_payload_vanishes_and_is_refused_where_nothing_is_free():
    driven = drive(duration=1.0)
    for signal, values in simulate(driven, rig=pendulum_rig()).items():
        with_none = simulate(driven, "gravity_error", {"torque": 0.0}, pendulum_rig())[signal]
        np.testing.assert_array_equal(with_none, values)
    with pytest.raises(ParameterError, match="both ends clamped, expected a free one"):
        simulate(driven, "gravity_error", {"torque": 1.0})


def test_a_drift_far_longer_than_the_record_is_a_straight_line():
    driven = drive(duration=2.0)
    straight, slow = (
        simulate(driven, "ft_drift", {"drift": 3.0, "time_constant": tau})["ft"]
        for tau in (np.inf, 299.0 * 2.0)
    )
    assert rms(straight - slow) < 1e-3
