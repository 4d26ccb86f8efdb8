"""Units that a column of a measurement may be in."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rsea_ros.documents.units import same_unit
from rsea_ros.documents.wording import quote

FACTORS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {
        "rad": 1.0,
        "mrad": 1e-3,
        "deg": math.pi / 180,
        "arcmin": math.pi / 10800,
        "rev": 2 * math.pi,
    },
    "angular velocity": {
        "rad/s": 1.0,
        "deg/s": math.pi / 180,
        "rev/s": 2 * math.pi,
        "rpm": 2 * math.pi / 60,
    },
    "torque": {"N m": 1.0, "mN m": 1e-3, "N mm": 1e-3, "N cm": 1e-2, "kN m": 1e3},
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "current": {"A": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "number": {"1": 1.0},
}
"""By dimension: the units and what one of them is in SI."""

LINEAR: Mapping[str, str] = {"length": "angle", "velocity": "angular velocity", "force": "torque"}
"""What stands in for what where the machine is a linear drive: m for rad, N for N m."""

CHANNELS: Mapping[str, str] = {
    "command": "torque",
    "motor_torque": "torque",
    "ft": "torque",
    "deflection": "angle",
    "position": "angle",
    "velocity": "angular velocity",
    "reference": "angle",
}
"""By channel of a record: its dimension."""


def unit(text: object) -> tuple[str, float]:
    """Return dimension and SI factor of a unit, however it is written; raises as canonical does."""
    name = canonical(text)
    return next((dimension, factors[name]) for dimension, factors in FACTORS.items() if name in factors)


def canonical(text: object) -> str:
    """Return the name of a unit in FACTORS: `Nm`, `N*m` and `N·m` are `N m`.

    Raises ValueError for an unknown one.
    """
    for factors in FACTORS.values():
        for name in factors:
            if same_unit(text, name):
                return name
    known = ", ".join(name for factors in FACTORS.values() for name in factors)
    raise ValueError(f"unit {quote(text)} unknown, expected one of {known}")
