"""Findings on the rig: its own values, the clocks of its sensors, and another machine than it states.

Values are those of a fit without gains: the linearised fit leaves them free, which a common factor imitates.

A sensor's clock may run so fast or slow that the phases turn within the record. The lag behind the rig's
simulation, followed from second to second (identification/clocks.py), says how fast; taken out, the rest is
small enough for the linearised fit. Where the rig misfits even so, a cause bends the lags of all sensors: the
lag of ft behind the joint's own motion is the number then.

Another machine than a rig without a spring states shows in the torque that acted, by least squares along the
measured motion, without and with restoring terms:

    T = J q'' + b q' + c sign(q') + T_0 (+ K q + G sin(q - q_0))
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.checks.expected import Side
from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.linearised_rig import BESIDE, LinearisedFit, Number
from rsea_ros.checks.pairs import Pair, predicted
from rsea_ros.checks.verdicts import RIGHT_RIG
from rsea_ros.errors import RseaError
from rsea_ros.identification.clocks import LEAST_RISE, SCATTER, LagLine, lag_line
from rsea_ros.identification.confidence import FAR, confidence_of, off_rig, parameters_of
from rsea_ros.identification.fit import reweight
from rsea_ros.identification.result import ParameterEstimate, Remark
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import unknowns_of_rig
from rsea_ros.model.inverse import Motion, motion_from
from rsea_ros.model.rig import CLOCK_DOUBT, Rig
from rsea_ros.records.record import SENSED, Channel, FloatArray, Record
from rsea_ros.records.statistics import Z95

_ALLOWED = 3.0 * CLOCK_DOUBT
"""s. As far as a fit lets a sensor's clock move."""
SURE = 4.0
"""Sigmas."""
_OPEN = 10.0 * _ALLOWED
"""s. One sigma from which a number would say nothing of a clock."""
JOINT = ("velocity", "position")
_RELATIVE = "against the model; a delay of the drive looks the same"


def clock_findings(linear: LinearisedFit, duration: float) -> Iterator[Finding]:
    """Yield offset and drift of every sensor's stamps against the command's. duration: of the record, s."""
    if not linear.settled:
        yield Finding("green", "clock_offset", "", detail="not determined beside what the rig leaves")
        return
    for name, offset in linear.offset.items():
        yield _offset(name, offset, linear)
        yield _drift(name, linear.drift[name], linear, duration)


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
        if sure and abs(apart) > _ALLOWED and linear.fits:
            light, detail = "amber", f"{1e6 * apart:.4g} µs later than {best}, {_RELATIVE}"
    remedy = "stamp both at acquisition by one clock" if light == "amber" else ""
    return Finding(
        light, "clock_offset", name, 1e6 * offset.value, "µs", 1e6 * low, 1e6 * high,
        expected=f"within {1e6 * _ALLOWED:.0f} µs of the others", detail=detail + _beside(linear, name),
        remedy=remedy,
    )


def _drift(name: str, drift: Number, linear: LinearisedFit, duration: float) -> Finding:
    if drift.sd * duration > _OPEN:
        return _undetermined_clock("clock_drift", name, drift.sd * duration)
    sure = abs(drift.value) > SURE * drift.sd and abs(drift.value) * duration > _ALLOWED
    light: Light = "amber" if sure and linear.fits else "green"
    return drift_finding(light, name, drift, duration, _beside(linear, name).removeprefix("; "))


def drift_finding(light: Light, name: str, drift: Number, duration: float, beside: str) -> Finding:
    """Return the finding of a drift (s/s). duration: of the record, s. beside: what else it may be."""
    low, high = drift.ci95
    return Finding(
        light, "clock_drift", name, 1e6 * drift.value, "ppm", 1e6 * low, 1e6 * high,
        expected=f"within {1e6 * _ALLOWED / duration:.3g} ppm",
        detail="; ".join(filter(None, ("of its clock against the command's", beside))),
        remedy="discipline the clocks (PTP, chrony), or stamp by one" if light == "amber" else "",
    )


def _undetermined_clock(kind: str, name: str, sd: float) -> Finding:
    """Return that these data do not determine a clock. sd: s, of its offset or of its drift by the end."""
    detail = f"not determined: these data leave {1e3 * sd:.2g} ms, one sigma"
    return Finding("green", kind, name, detail=detail)


def _beside(linear: LinearisedFit, name: str) -> str:
    if (misfit := linear.misfit[name]) < BESIDE:
        return ""
    return f"; beside a misfit of {misfit:.0f} times the noise a cause may stand in for it"


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
    off = off_rig(parameters) if linear.settled or linear.fits else ()
    return [*(_identifiability(p) for p in parameters), *(_far(remark, rig) for remark in off)]


def _identifiability(p: ParameterEstimate) -> Finding:
    amber = p.determined == "no"
    return Finding(
        "amber" if amber else "green", "identifiability", p.name,
        50.0 * (p.ci95[1] - p.ci95[0]) / Z95 / (abs(p.value) or 1.0), "%",
        expected="below the rig's spread",
        detail="one sigma, only with what the rig states" if amber else "one sigma that these data leave",
        remedy="measure it separately, or excite it more" if amber else "",
    )


def _far(remark: Remark, rig: Rig) -> Finding:
    (name,), (stated, value, low, high, spreads) = remark.names, remark.values
    return Finding(
        "amber", "rig_value", name, value, remark.unit, low, high,
        expected=f"{stated:.4g}, to {100.0 * FAR * rig.spread(name):.3g} %",
        detail=f"fitted, {spreads:.2g} of the rig's stated spreads away", remedy=RIGHT_RIG,
    )


_STEEPEST = 1.8e-3
"""s/s. The lag is followed from block to block up to 2 ms/s; no line near that is trusted."""
def lag_lines(compared: Mapping[str, Side], start: float) -> dict[str, LagLine]:
    """Return the line through the lags of every sensor that shows one. start: of the record, s."""
    lines = {n: lag_line(s.t, s.y, s.p, start) for n, s in compared.items() if n in SENSED}
    return {n: line for n, line in lines.items() if line is not None}


def clock_rates(lines: Mapping[str, LagLine]) -> dict[str, float]:
    """Return the rate (s/s) at which channels come later and later than predicted, where a line shows it."""
    clear = {n: line for n, line in lines.items() if line.scatter < SCATTER * abs(line.rise)}
    return {n: line.rate for n, line in clear.items() if _rises(line)}


def _rises(line: LagLine) -> bool:
    """Return whether a line rises too far for a linear fit, and no faster than clocks run."""
    return abs(line.rise) > LEAST_RISE and abs(line.rate) < _STEEPEST


_STRAIGHT = 5.0
"""Times its bend: what a cause in spring or sensor makes of the lag is at most 4.5 (decision 323)."""
_PLAINLY = 0.25
"""Of what the lines behind the rig are off if the drift is ft's: if it is the joint's, for it to be that."""


def drift_findings(record: Record, lines: Mapping[str, LagLine], pairs: Sequence[Pair]) -> list[Finding]:
    """Return the drifts that lags show where the rig misfits; amber needs two channels that agree on it.

    Behind a rig that misfits the lag of every sensor bends along the record. That of ft behind the joint's
    own motion hardly does: where it rises its line is the number, of ft, unless joint_states plainly run
    otherwise than the command.
    """
    between = [(p.law.x, line) for p in pairs if p.law.x != "ft" for line in _behind(record, p, "ft")]
    x, line = min(between, key=lambda one: one[1].scatter, default=("", None))
    if line is None or not _is_straight(line):
        beside = "seen beside a misfit of the rig, for which a cause may stand in for it"
        straight = {n: one for n, one in lines.items() if _is_straight(one)}
        return [_drift_of("green", n, one, one.rate, abs(one.rate), beside) for n, one in straight.items()]
    echoes = [one.rate for p in pairs if p.law.x == "command" for one in _behind(record, p, "motor_torque")]
    joint = echoes[0] if echoes else lines[x].rate if x in lines else 0.0
    off = joint + line.rate if echoes else lines["ft"].rate if "ft" in lines else 0.0
    is_joint = abs(off) + abs(joint + line.rate) < _PLAINLY * (abs(off - line.rate) + abs(joint))
    names = [n for n in lines if n == x or {n, x} <= set(JOINT)] if is_joint else ["ft"]
    rate = -line.rate if is_joint else line.rate
    return [_drift_of("amber", n, line, rate, line.bend, f"seen between ft and {x}") for n in names]


def _behind(record: Record, pair: Pair, name: str) -> Iterator[LagLine]:
    """Yield the line of a channel's lag behind what a pair makes of the other, where there is one."""
    expected = predicted(record, pair, name)
    if expected is not None:
        line = lag_line(record[name].t, record[name].y, expected, float(record["command"].t[0]))
        yield from [] if line is None else [line]


def _is_straight(line: LagLine) -> bool:
    return _rises(line) and abs(line.rate) > _STRAIGHT * line.bend


def _drift_of(light: Light, name: str, line: LagLine, rate: float, doubt: float, beside: str) -> Finding:
    return drift_finding(light, name, Number(rate, doubt), abs(line.rise / line.rate), beside)


def at_rates(record: Record, rates: Mapping[str, float]) -> Record:
    """Return the record with the stamps that some channels would have, did their clocks run as the command's.

    rates: s/s by channel, since the first command.
    """
    start = float(record["command"].t[0])
    moved = {n: Channel(c.t - rate * (c.t - start), c.y) for n, rate in rates.items() for c in [record[n]]}
    return record.with_channels(**moved)


_FALLS = 0.55
"""Of what is left of the torque: with a spring or pendulum that is there, less is left."""
_EDGE = 0.02
"""Of the record at either end, where the filter settles."""
_SHARP = 0.05
"""Of the speed's RMS: the width of its sign's step."""


def restoring_findings(record: Record, rig: Rig) -> Iterator[Finding]:
    """Yield the finding of a torque that follows the position, for a rig that has neither K nor gravity."""
    if rig["spring_end.stiffness"] or rig["spring_end.gravity"]:
        return
    try:
        motion = motion_from(record)
    except (RseaError, ValueError):
        return
    without, held = residual_shares(motion)
    if not held < _FALLS * without:
        return
    yield Finding(
        "red", "wrong_rig", "spring_end.stiffness", 100.0 * (1.0 - (held / without) ** 2), "%",
        expected="0",
        detail="of the torque that the rig leaves open follows the position: a spring or a pendulum",
        remedy=RIGHT_RIG,
    )  # fmt: skip


def residual_shares(motion: Motion) -> tuple[float, float]:
    """Return the share of the torque's RMS that is left without and with the restoring terms."""
    sign = np.tanh(motion.v / max(_SHARP * float(np.std(motion.v)), 1e-300))
    holding = [motion.q, np.sin(motion.q), np.cos(motion.q)]
    moving = [motion.a, motion.v, sign, np.ones_like(motion.v)]
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    without, held = ([c[known] for c in columns] for columns in (moving, [*moving, *holding]))
    return _rms_left(without, motion.torque[known]), _rms_left(held, motion.torque[known])


def _rms_left(columns: list[FloatArray], torque: FloatArray) -> float:
    edge = int(_EDGE * len(torque))
    inside = slice(edge, len(torque) - edge)
    rows = np.column_stack(columns)[inside]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    y = torque[inside]
    return float(np.std(y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]) / max(float(np.std(y)), 1e-300))
