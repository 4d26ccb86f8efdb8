"""How large a hidden effect is: mild, medium or strong, drawn from a seed."""

from types import MappingProxyType

import numpy as np
from independent.hidden import MAIN_PARAMETER

SEVERITIES = ("mild", "medium", "strong")

SIZES = MappingProxyType(
    {
        "torque_constant_error": (0.05, 0.12, 0.22),  # away from 1, either way
        "coulomb_friction": (0.3, 1.0, 3.0),
        "stribeck_friction": (0.8, 1.5, 2.5),
        "asymmetric_friction": (0.4, 1.2, 2.5),
        "load_dependent_friction": (0.02, 0.05, 0.12),
        "backlash": (0.6e-3, 1.75e-3, 5.0e-3),
        "nonlinear_spring": (120.0, 350.0, 800.0),
        "spring_hysteresis": (0.4, 1.0, 2.5),
        "structural_resonance": (0.08, 0.25, 0.6),  # participation
        "command_delay": (1.2e-3, 5.4e-3, 14.0e-3),
        "current_loop_lag": (1.0e-3, 3.0e-3, 8.0e-3),
        "ft_sensor_lag": (2.4e-3, 3.5e-3, 6.0e-3),
        "torque_ripple": (0.2, 0.6, 1.5),
        "torque_saturation": (38.0, 28.0, 18.0),
        "ft_drift": (0.15, 0.5, 1.5),
        "ft_bias": (0.15, 0.5, 1.5),
        "ft_gain_error": (0.05, 0.12, 0.22),  # away from 1, either way
        "mains_interference": (0.08, 0.2, 0.5),
        "base_compliance": (1.4e4, 9.0e3, 5.0e3),
        "stiffness_drift": (0.02, 0.06, 0.15),  # either way
        "damping_drift": (0.10, 0.20, 0.35),  # either way
        "hard_stop": (15.0e-3, 12.0e-3, 9.0e-3),
        "gear_compliance": (2.0e4, 8.0e3, 4.0e3),
    }
)
"""Size of each effect, in the unit of its main parameter where no comment says otherwise."""


def drawn_parameters(effect, severity, rng):
    """Return parameters of an effect in the contract's units; the size is drawn within 15 % of SIZES."""
    size = SIZES[effect][SEVERITIES.index(severity)] * rng.uniform(0.85, 1.15)
    either = float(rng.choice((-1.0, 1.0)))
    if effect in ("torque_constant_error", "ft_gain_error"):
        return {"gain": 1.0 + either * size}
    if effect in ("ft_drift", "ft_bias", "stiffness_drift", "damping_drift"):
        return {{"ft_drift": "drift", "ft_bias": "bias"}.get(effect, "relative_change"): either * size}
    return _MORE.get(effect, _only)(effect, size, rng)


def _only(effect, size, _rng):
    return {MAIN_PARAMETER[effect]: size}


def _stribeck(_effect, size, rng):
    return {
        "coulomb_torque": size,
        "stribeck_torque": size * rng.uniform(0.7, 1.2),
        "stribeck_velocity": 0.05,
    }


def _asymmetric(_effect, size, rng):
    return {"offset": size, "viscous_difference": size * rng.uniform(0.8, 2.0)}


def _hysteresis(_effect, size, rng):
    return {"torque": size, "angle": rng.uniform(1.5e-3, 4.0e-3)}


def _resonance(_effect, size, rng):
    return {
        "frequency": rng.uniform(22.0, 75.0),
        "damping_ratio": rng.uniform(0.015, 0.04),
        "participation": size,
    }


def _ripple(_effect, size, rng):
    return {
        "amplitude": size,
        "cycles_per_revolution": float(rng.choice((1, 2, 4, 6))),
        "phase": rng.uniform(-np.pi, np.pi),
    }


def _mains(_effect, size, rng):
    return {"amplitude": size, "frequency": float(rng.choice((50.0, 60.0))) + rng.uniform(-0.05, 0.05)}


def _base(_effect, size, rng):
    omega = 2.0 * np.pi * rng.uniform(15.0, 40.0)
    return {"stiffness": size, "inertia": (size + 1530.0) / omega**2}


def _stop(_effect, size, rng):
    return {"angle": size, "stiffness": rng.uniform(3.0e3, 8.0e3)}


_MORE = {
    "stribeck_friction": _stribeck,
    "asymmetric_friction": _asymmetric,
    "spring_hysteresis": _hysteresis,
    "structural_resonance": _resonance,
    "torque_ripple": _ripple,
    "mains_interference": _mains,
    "base_compliance": _base,
    "hard_stop": _stop,
}
