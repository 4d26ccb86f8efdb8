"""The rig fitted with right gains and clocks: which values the data determine, and which are far from it.

The linearised fit does not say that: it leaves the gains free, which a common factor of the values imitates.
"""

from __future__ import annotations

import math
from dataclasses import replace

from rsea_ros.checks.finding import Finding
from rsea_ros.checks.gain_findings import RIGHT_RIG
from rsea_ros.checks.linearised_rig import LinearisedFit
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.estimates import parameters_of
from rsea_ros.identification.misfit import reweight
from rsea_ros.identification.off_rig import FAR, off_rig
from rsea_ros.identification.remark import Remark
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import unknowns_of_rig
from rsea_ros.model.rig import Rig
from rsea_ros.records.normal import Z95

_STEPS = 8


def value_findings(linear: LinearisedFit, rig: Rig) -> list[Finding]:
    """Return for each value of the rig whether these data determine it, and those that are far off."""
    unknowns = unknowns_of_rig(rig)
    if not unknowns:
        return []
    cases = tuple(reweight(case, linear.misfit) for case in linear.problem.cases)
    problem = replace(linear.problem, cases=cases, unknowns=unknowns)
    solution = solve(problem, linear.theta, iterations=_STEPS)
    if not math.isfinite(solution.cost):
        return []
    parameters = parameters_of(solution, confidence_of(solution))
    off = off_rig(parameters) if linear.settled else ()
    return [*(_identifiability(p) for p in parameters), *(_far(remark, rig) for remark in off)]


def _identifiability(p: ParameterEstimate) -> Finding:
    amber = p.determined == "no"
    return Finding(
        "amber" if amber else "green",
        "identifiability",
        p.name,
        50.0 * (p.ci95[1] - p.ci95[0]) / Z95 / (abs(p.value) or 1.0),
        "%",
        expected="below the rig's spread",
        detail="one sigma, only with what the rig states" if amber else "one sigma that these data leave",
        remedy="measure it separately, or excite it more" if amber else "",
    )


def _far(remark: Remark, rig: Rig) -> Finding:
    (name,), (stated, value, low, high, spreads) = remark.names, remark.values
    return Finding(
        "amber",
        "rig_value",
        name,
        value,
        remark.unit,
        low,
        high,
        expected=f"{stated:.4g}, to {100.0 * FAR * rig.spread(name):.3g} %",
        detail=f"fitted, {spreads:.2g} of the rig's stated spreads away",
        remedy=RIGHT_RIG,
    )
