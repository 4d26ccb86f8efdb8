"""The loads that a controller must tolerate: the actuator clamped at both ends, free, or in between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from rsea_ros.control.law import check_controllable
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_file import load_rig

LIGHTEST = "paper_moving_output"
LOCKED = "locked"
MULTIPLES = (0.5, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0)
"""Of the free ends' inertia. At 100 times the paper's load hardly moves at the frequencies of control."""


def load_range(rig: Rig, free: Rig | None = None) -> Mapping[str, Rig]:
    """Return the rig by load: `locked`, and the free ends of `free` with 0.5 to 100 times their inertia.

    free: a bench whose ends are the lightest load; by default the rig itself. The actuator is the rig's in
    all. Raises ParameterError where `free` has no free end, or nothing can be controlled.
    """
    check_controllable(rig)
    loads = {LOCKED: lock(rig)}
    light = with_ends(rig, free or rig)
    ends = [end for end in END_NAMES if light.end_is_free(end)]
    if free is not None and not ends:
        raise ParameterError(
            f"rig {free.name}: both ends are clamped, expected a free one: it is the lightest load"
        )
    for multiple in MULTIPLES if ends else ():
        inertias = {f"{end}.inertia": multiple * light[f"{end}.inertia"] for end in ends}
        loads[f"free x {multiple:g}"] = light.with_values(inertias)
    return loads


def lightest(rig: Rig, name: str = "") -> Rig:
    """Return the rig whose ends are the lightest load: that of a name, else the rig, LIGHTEST if clamped."""
    if name:
        return load_rig(name)
    return load_rig(LIGHTEST) if rig.clamped == set(END_NAMES) else rig


def lock(rig: Rig) -> Rig:
    """Return the rig with both ends clamped."""
    return replace(rig, clamped=frozenset(END_NAMES))


def with_ends(rig: Rig, other: Rig) -> Rig:
    """Return the rig with the ends and loads of another one."""
    prefixes = (*(f"{end}." for end in END_NAMES), "housing.", "proximal_spring.")
    ends = {name: q for name, q in other.quantities.items() if name.startswith(prefixes)}
    rest = {name: q for name, q in rig.quantities.items() if not name.startswith(prefixes)}
    return replace(rig, quantities={**rest, **ends}, clamped=other.clamped)
