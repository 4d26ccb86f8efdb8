"""The values that a rig may have: name, unit, smallest value, default. FIELDS is the only list of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from rsea_ros.documents.units import with_unit
from rsea_ros.errors import RigError

LEAST_SIZE, GREATEST_SIZE = 1e-12, 1e12
"""Limits of the size of a nonzero value; beyond them the equations have no accurate digit."""
END_NAMES = ("housing_end", "spring_end")


@dataclass(frozen=True)
class Field:
    """A possible value of a rig: unit, lower bound, whether the bound is allowed, default."""

    unit: str
    low: float = 0.0
    low_allowed: bool = True
    default: float | None = None


_END_FIELDS = {
    "inertia": Field("kg m^2", low_allowed=False),
    "damping": Field("N m s/rad", default=0.0),
    "stiffness": Field("N m/rad", default=0.0),
    "gravity": Field("N m", default=0.0),
    "gravity_angle": Field("rad", low=-math.inf, default=0.0),
}

LOOP_FIELDS: Mapping[str, Mapping[str, Field]] = {
    "pd": {
        "k_p": Field("N m/rad"),
        "k_i": Field("N m/rad/s", default=0.0),
        "k_d": Field("N m s/rad", default=0.0),
        "k_f": Field("N m s/rad", default=0.0),
    },
    "cascade": {
        "k_pos": Field("1/s"),
        "k_v": Field("N m s/rad"),
        "k_vi": Field("N m/rad", default=0.0),
    },
}
"""Gains of the kinds of position loop (model/firmware_loop.py)."""
_LIMIT_FIELDS = {
    "torque_limit": Field("N m", low_allowed=False, default=math.inf),
    "velocity_limit": Field("rad/s", low_allowed=False, default=math.inf),
    "sample_time": Field("s", default=0.0),
}
LOOP_LIMITS = tuple(_LIMIT_FIELDS)

FIELDS: Mapping[str, Field] = MappingProxyType(
    {
        "rotor.reflected_inertia": Field("kg m^2", low_allowed=False),
        "rotor.reflected_damping": Field("N m s/rad"),
        "gear.ratio": Field("1", low=1.0, default=1.0),
        "gear.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
        "gear.damping": Field("N m s/rad", default=0.0),
        "chassis.inertia": Field("kg m^2", default=0.0),
        "spring.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
        "spring.damping": Field("N m s/rad", default=0.0),
        "housing.inertia": Field("kg m^2", default=0.0),
        "proximal_spring.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
        "proximal_spring.damping": Field("N m s/rad", default=0.0),
        **{f"{end}.{key}": f for end in END_NAMES for key, f in _END_FIELDS.items()},
        **{f"controller.{key}": f for gains in LOOP_FIELDS.values() for key, f in gains.items()},
        **{f"controller.{key}": f for key, f in _LIMIT_FIELDS.items()},
        "spring_end.above_sensor": Field("1", default=0.0),
    }
)


def unit_of(name: str) -> str:
    """Return the unit of a rig field. Raises RigError for an unknown name."""
    if name not in FIELDS:
        raise RigError(f"{name}: no such rig field, expected one of {', '.join(FIELDS)}")
    return FIELDS[name].unit


def check_value(name: str, value: float, where: str = "rig") -> None:
    """Raise RigError when a value is not a possible one for its field."""
    unit, stated = unit_of(name), f"{where}: {name} = {value:g}"
    low, allowed = FIELDS[name].low, FIELDS[name].low_allowed
    infinite_ok = FIELDS[name].default == math.inf
    possible = (value >= low if allowed else value > low) and (math.isfinite(value) or infinite_ok)
    if possible and math.isfinite(value) and value != 0.0 and not LEAST_SIZE <= abs(value) <= GREATEST_SIZE:
        sizes = with_unit(f"a size between {LEAST_SIZE:g} and {GREATEST_SIZE:g}", unit)
        raise RigError(f"{with_unit(stated, unit)}, expected {sizes}", name)
    if not possible:
        bound = with_unit(f">= {low:g}" if allowed else f"> {low:g}", unit)
        raise RigError(f"{with_unit(stated, unit)}, expected a finite value {bound}", name)
