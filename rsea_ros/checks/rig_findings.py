"""Findings on the rig's own values: what a linear fit moves, and how far from what the rig states.

The linearised fit does not say that: it leaves the gains free, which a common factor of the values imitates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.gain_findings import RIGHT_RIG
from rsea_ros.checks.linearised_rig import BESIDE, LinearisedFit, Number
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.estimates import FAR, off_rig, parameters_of
from rsea_ros.identification.fit import reweight
from rsea_ros.identification.result import ParameterEstimate, Remark
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import unknowns_of_rig
from rsea_ros.model.rig import CLOCK_DOUBT, Rig
from rsea_ros.records.normal import Z95

_ALLOWED = 3.0 * CLOCK_DOUBT
"""s. As far as a fit lets a sensor's clock move."""
SURE = 4.0
"""Sigmas."""
_OPEN = 10.0 * _ALLOWED
"""s. One sigma from which a number would say nothing of a clock."""
JOINT = ("velocity", "position")
_RELATIVE = "against the model; a delay of the drive looks the same"


def clock_findings(linear: LinearisedFit, duration: float) -> list[Finding]:
    """Return offset and drift of every sensor's stamps against the command's. duration: of the record, s."""
    if not linear.settled:
        return [Finding("green", "clock_offset", "", detail="not determined beside what the rig leaves")]
    findings = []
    for name, offset in linear.offset.items():
        findings.append(_offset(name, offset, linear))
        findings.append(_drift(name, linear.drift[name], linear, duration))
    return findings


def _offset(name: str, offset: Number, linear: LinearisedFit) -> Finding:
    """Return the finding of an offset; only sensors that disagree with each other make a fault."""
    if offset.sd > _OPEN:
        return _undetermined_clock("clock_offset", name, offset.sd)
    others = [n for n in linear.offset if (n in JOINT) != (name in JOINT)]
    low, high = offset.ci95
    light: Light = "green"
    detail = _RELATIVE
    if name == "ft" and others:
        best = min(others, key=lambda n: linear.offset[n].sd)
        apart = offset.value - linear.offset[best].value
        sure = abs(apart) > SURE * (offset.sd**2 + linear.offset[best].sd ** 2) ** 0.5
        if sure and abs(apart) > _ALLOWED and _is_clear(linear, tuple(linear.misfit)):
            light, detail = "amber", f"{1e6 * apart:.4g} µs later than {best}, {_RELATIVE}"
    remedy = "stamp both at acquisition by one clock" if light == "amber" else ""
    return Finding(
        light,
        "clock_offset",
        name,
        1e6 * offset.value,
        "µs",
        1e6 * low,
        1e6 * high,
        expected=f"within {1e6 * _ALLOWED:.0f} µs of the others",
        detail=detail + _beside(linear, name),
        remedy=remedy,
    )


def _drift(name: str, drift: Number, linear: LinearisedFit, duration: float) -> Finding:
    if drift.sd * duration > _OPEN:
        return _undetermined_clock("clock_drift", name, drift.sd * duration)
    sure = abs(drift.value) > SURE * drift.sd and abs(drift.value) * duration > _ALLOWED
    light: Light = "amber" if sure and _is_clear(linear, (name,)) else "green"
    return drift_finding(light, name, drift, duration, _beside(linear, name).removeprefix("; "))


def drift_finding(light: Light, name: str, drift: Number, duration: float, beside: str) -> Finding:
    """Return the finding of a drift (s/s). duration: of the record, s. beside: what else it may be."""
    low, high = drift.ci95
    return Finding(
        light,
        "clock_drift",
        name,
        1e6 * drift.value,
        "ppm",
        1e6 * low,
        1e6 * high,
        expected=f"within {1e6 * _ALLOWED / duration:.3g} ppm",
        detail="; ".join(filter(None, ("of its clock against the command's", beside))),
        remedy="discipline the clocks (PTP, chrony), or stamp by one" if light == "amber" else "",
    )


def _undetermined_clock(kind: str, name: str, sd: float) -> Finding:
    """Return that these data do not determine a clock. sd: s, of its offset or of its drift by the end."""
    detail = f"not determined: these data leave {1e3 * sd:.2g} ms, one sigma"
    return Finding("green", kind, name, detail=detail)


def _is_clear(linear: LinearisedFit, names: Sequence[str]) -> bool:
    return all(linear.misfit[n] < BESIDE for n in names)


def _beside(linear: LinearisedFit, name: str) -> str:
    misfit = linear.misfit[name]
    return (
        ""
        if misfit < BESIDE
        else f"; beside a misfit of {misfit:.0f} times the noise a cause may stand in for it"
    )


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
