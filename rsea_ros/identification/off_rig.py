"""Fitted values that lie far from those of the rig: another bench, or a rig that is out of date."""

from __future__ import annotations

from collections.abc import Iterable

from rsea_ros.identification.determined import IDENTIFIABLE_SHARE
from rsea_ros.identification.remark import Remark
from rsea_ros.identification.result import CLOCKS, ParameterEstimate
from rsea_ros.identification.solver import Solution

FAR = 3.0
"""Stated spreads of a value: one right rig in 400 lies further off by chance."""


def is_off(spreads: float, told_by_data: float) -> bool:
    """Return whether a value is surely not the rig's: far from it, and determined by the data."""
    return abs(spreads) > FAR and told_by_data >= IDENTIFIABLE_SHARE


def is_off_rig(solution: Solution) -> bool:
    """Return whether a fit has taken some value of the rig that far, determined by the data or not."""
    stated = solution.problem.rig.free()
    unknowns = zip(solution.problem.unknowns, solution.theta, strict=True)
    return any(u.name in stated and u.sigmas(float(t)) > FAR for u, t in unknowns)


def off_rig(parameters: Iterable[ParameterEstimate]) -> tuple[Remark, ...]:
    """Return a remark for each value that the data put far from the value of the rig."""
    return tuple(
        Remark("off_rig", (p.name,), (p.start, p.value, *p.ci95, p.spreads_off), p.unit)
        for p in parameters
        if not p.name.startswith(CLOCKS) and is_off(p.spreads_off, p.told_by_data)
    )
