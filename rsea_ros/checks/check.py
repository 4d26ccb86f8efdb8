"""All checks of a record before physics is fitted to it, in tenths of a second."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.checks import expected, rig_findings, signal_findings
from rsea_ros.checks.faults import Checked, check
from rsea_ros.checks.finding import Finding, Findings, in_words_of, missing_command, unused_sentence
from rsea_ros.checks.linearised_rig import LinearisedFit, Number, Start, linear_of
from rsea_ros.checks.pairs import is_held
from rsea_ros.checks.stamp_findings import command_band, fault_finding, order, rates
from rsea_ros.checks.verdicts import RIGHT_RIG, in_step, start_of, verdict_findings
from rsea_ros.errors import RseaError
from rsea_ros.identification.solver import one_blas_thread
from rsea_ros.model.extent import bound_values, is_too_fast
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Channel, Fault, Record
from rsea_ros.records.stamps import repair_stamps

Wrench = Callable[[], Mapping[str, Channel]]
"""Reads the other axes of the wrench, by their names for --axis."""
_WHOLE = 0.1
"""Share of masked samples above which a channel's response is not compared."""
_APART = 5.0
"""Factor between the sizes of a channel and of what the rig would give, from which the rig is in doubt."""
_BRIDGED = 0.01
"""Share of masked samples above which the lines that bridge them are no measure of a sensor's noise."""
_FOLLOWS = {"angle_jumps": "clock_offset", "coarse_steps": "scale"}
"""What a fault of a channel makes by itself: a lag that changes a jump, another unit coarse steps."""
_NO_FIT = ("sign", "scale", "clock_offset", "wrong_rig")
"""Kinds of findings beside which, where red, a fit of the whole record says nothing."""
FAULTY = (
    "sign", "scale", "offset", "angle_jumps", "standstill", "smoothing", "clock_offset", "clock_drift",
    "wrong_rig",
)  # fmt: skip
"""Kinds of findings that every result made from the record repeats, where they are not green."""


def check_record(
    record: Record, rig: Rig, axis: str = "torque.z", wrench: Wrench | None = None, values: bool = False
) -> Findings:
    """Return the findings of a record for a rig, each with a traffic light.

    Nothing is changed or masked. axis: of the wrench that `ft` was read from. wrench: the other axes,
    tried where `ft` has nothing to do with the command. values: fit the rig and add which of its values
    these data determine, and which are far off, as identify and diagnose do themselves.
    Raises nothing for data that are merely bad.
    """
    rig = rig.under(record.source)
    with one_blas_thread(), np.errstate(all="ignore"):
        if rig.loop is not None and "reference" not in record:
            no_targets = Finding(
                "red", "topics", "reference", expected="the target positions that drove the run",
                detail=f"only {', '.join(record.channels)}",
                remedy="record the targets, or name their topic with --topic desired_position=…",
            )  # fmt: skip
            return Findings(record.source, rig.name, (no_targets,), record.faults)
        have = "; ".join(filter(None, (", ".join(record.channels), unused_sentence(record, rig))))
        record = bound_values(record if rig.loop is None else with_command(record, rig))
        checked = check(record, rig)
        every = [*_topics(record, have), *(fault_finding(f) for f in checked.faults)]
        moving = "command" in checked.record and len(checked.record["command"]) > 2
        top = command_band(checked.record["command"])[1] if moving else math.inf
        every += [*order(record), *rates(record, rig, top)]
        if moving:
            every += signal_findings.excitation(checked.record, rig)
            every += signal_findings.jump_findings(checked.record)
            every += [] if _bridged_channels(checked) else signal_findings.standstill_findings(checked.record)
            if expected.is_commanded(checked.record) and not is_too_fast(checked.record):
                every += _against_rig(checked, rig, axis, values)
        every += _other_axes(checked, rig, axis, wrench)
    red = {(f.kind, f.channel) for f in every if f.light == "red"}  # of which others are consequences
    every = [in_words_of(record, f) for f in every if (_FOLLOWS.get(f.kind), f.channel) not in red]
    idle = (replace(f, kind="no_excitation") for f in every if (f.kind, f.light) == ("excitation", "red"))
    doubts = (*(f for f in every if f.kind in FAULTY and f.light != "green"), *idle)
    kept = {(f.kind, f.channel) for f in every}
    known = (f for f in checked.faults if f.kind not in _FOLLOWS or (f.kind, f.channel) in kept)
    faults = (*known, *map(_fault, doubts))
    findings = tuple(_of_targets(f) for f in every) if rig.loop is not None else tuple(every)
    found = tuple(dict.fromkeys(findings))
    return Findings(record.source, rig.name, found, faults, pairs=checked.pairs, masked=checked.masked)


def _of_targets(f: Finding) -> Finding:
    """Return a finding about the command as one about the target positions that it is."""
    if f.channel != "command":
        return f
    unit, detail = ("rad" if f.unit == "N m" else f.unit), f.detail.replace("N·m", "rad")
    return replace(f, channel="reference", unit=unit, detail=detail)


def _topics(record: Record, have: str) -> Iterator[Finding]:
    if "command" in record:
        yield Finding("green", "topics", "", float(len(record.channels)), "1", detail=have)
        return
    yield Finding(
        "red", "topics", "command", expected="the torques that drove the run", detail=f"only {have}",
        remedy=missing_command(record),
    )  # fmt: skip


def _against_rig(checked: Checked, rig: Rig, axis: str, values: bool) -> list[Finding]:
    """Return the findings from comparing the record with the rig's simulation."""
    if expected.is_full_of_gaps(checked.record):
        return [
            Finding(
                "red", "gaps", "", expected="a record without long gaps", detail="it is mostly gaps",
                remedy="cut it with --from and --to",
            )
        ]
    both = checked.compared if checked.compared is not None else expected.sides(checked.record, rig)
    findings, linear = _compare(checked, both, rig, axis, {}, values)
    if linear is None or not linear.is_clear:
        start = float(checked.record["command"].t[0])
        lines = rig_findings.lag_lines({n: s for n, s in both.items() if n in _whole(checked)}, start)
        rates = rig_findings.clock_rates(lines)
        if rates:
            even = replace(checked, record=rig_findings.at_rates(checked.record, rates))
            again, cleared = _compare(even, expected.sides(even.record, rig), rig, axis, rates, values)
            if cleared is not None and cleared.is_clear:
                return again
        if linear is not None:
            drifts = rig_findings.drift_findings(checked.record, lines, checked.pairs)
            return _with_drifts(findings, drifts)
    return findings


def _with_drifts(findings: list[Finding], drifts: list[Finding]) -> list[Finding]:
    """Return the findings with drifts estimated second by second in place of those of the fit."""
    followed = {f.channel for f in drifts}
    fitted = [f for f in findings if f.kind == "clock_drift" and f.channel in followed]
    vague = [f for f in findings if drifts and f.kind == "clock_offset" and not f.channel]
    return [*(f for f in findings if f not in fitted and f not in vague), *drifts]


def _compare(
    checked: Checked,
    both: Mapping[str, expected.Side],
    rig: Rig,
    axis: str,
    rates: Mapping[str, float],
    values: bool,
) -> tuple[list[Finding], LinearisedFit | None]:
    """Return the findings from measured and predicted channels, and the linearised fit if one makes sense.

    rates: of clocks (s/s) that are already taken out of the record.
    """
    record, whole = checked.record, _whole(checked)
    pairs = [p for p in checked.pairs if {p.law.x, p.law.y} <= whole]
    findings, late = verdict_findings(pairs, rig, axis)
    compared = {n: s for n, s in both.items() if n in whole}
    if late:
        record = in_step(record, late)
        compared = {n: s for n, s in expected.sides(record, rig).items() if n in whole}
    if elsewhere := list(signal_findings.angle_offset_findings(rig, compared)):
        return [*findings, *elsewhere], None
    wrong = {f.channel for f in findings if f.light == "red"}
    findings += [] if wrong & {"ft", "command"} else signal_findings.offset_findings(record, compared)
    findings += signal_findings.noises(record, rig, but=_bridged_channels(checked) | wrong)
    quotients = {n: expected.quotient(n, s.t, s.y, s.p) for n, s in compared.items()}
    related = {n: q for n, q in quotients.items() if q is not None}
    findings += signal_findings.smoothing_findings(related, {n: 1.0 / record[n].rate for n in related})
    findings += _another(record, rig, related, findings)
    if late or any(f.light == "red" and f.kind in _NO_FIT for f in findings):
        return findings, None
    start = start_of(pairs, rig)
    start = start._replace(delay={}) if rates else start  # the record is not the one that the pairs are of
    more, linear = _linearise(checked, rig, start, rates, values)
    return [*findings, *more], linear


def _whole(checked: Checked) -> set[str]:
    """Return the channels of which so little was masked that their response is compared."""
    return {n for n, bad in checked.masked.items() if np.count_nonzero(bad) < _WHOLE * len(bad)}


def _bridged_channels(checked: Checked) -> set[str]:
    """Return the channels of which so much was masked and bridged that what is between says nothing."""
    return {n for n, bad in checked.masked.items() if np.count_nonzero(bad) > _BRIDGED * len(bad)}


def _another(
    record: Record, rig: Rig, related: Mapping[str, expected.Quotient], known: Sequence[Finding]
) -> Iterator[Finding]:
    """Yield the findings by which the machine of a record differs from a rig whose values no pair shows."""
    named = {f.channel for f in known if f.kind != "noise"}
    if is_inverse(rig):
        is_told = not rig.rigid_spring or "spring_end.stiffness" in named
        yield from () if is_told else rig_findings.restoring_findings(record, rig)
        return
    if {f.kind for f in known} & {"sign", "scale", "wrong_rig", "clock_offset"} or is_held(rig):
        return
    about, one = "times what the rig would give", "about 1"
    for n, r in ((n, q.measured / q.predicted) for n, q in related.items() if n not in named):
        if max(r, 1.0 / max(r, 1e-300)) > _APART:
            yield Finding("amber", "wrong_rig", n, r, "1", expected=one, detail=about, remedy=RIGHT_RIG)


def _linearise(
    checked: Checked, rig: Rig, start: Start, rates: Mapping[str, float], values: bool
) -> tuple[list[Finding], LinearisedFit | None]:
    if is_inverse(rig):
        return [], None
    try:
        linear = linear_of(checked.record, checked.masked, rig, start)
        fitted = rig_findings.value_findings(linear, rig) if values else []
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return [], None
    duration = checked.record.stop - checked.record.start
    drift = {n: Number(d.value + rates.get(n, 0.0), d.sd) for n, d in linear.drift.items()}
    return [*rig_findings.clock_findings(replace(linear, drift=drift), duration), *fitted], linear


def _other_axes(checked: Checked, rig: Rig, axis: str, wrench: Wrench | None) -> Iterator[Finding]:
    """Yield which other axis of the wrench follows the command, where this one does not."""
    dead = any(f.kind == "dead_channel" and f.channel == "ft" for f in checked.faults)
    if wrench is None or not dead:
        return
    beside = {n: _beside(checked, rig, c) for n, c in wrench().items() if n != axis.removeprefix("-")}
    alive = {n: q for n, q in beside.items() if q is not None and not q.is_unrelated}
    if not alive:
        return
    best = max(alive, key=lambda n: alive[n].related)
    turned = "-" if float(np.sum(alive[best].weight * alive[best].value.real)) < 0.0 else ""
    yield Finding(
        "amber", "sign", "ft", alive[best].related, "1", expected="the actuator's axis",
        detail=f"{best} follows the command", remedy=f"--axis {turned}{best}",
    )  # fmt: skip


def _beside(checked: Checked, rig: Rig, channel: Channel) -> expected.Quotient | None:
    """Return the quotient of another channel taken for the F/T torque."""
    record, _ = repair_stamps(checked.record.with_channels(ft=channel))
    side: expected.Side | None = expected.sides(replace(record, faults=()), rig).get("ft")
    return None if side is None else expected.quotient("ft", side.t, side.y, side.p)


def _fault(f: Finding) -> Fault:
    """Return the fault of a finding; whether the rig is right is asked once, before the results."""
    detail = "; ".join(filter(None, (f.detail, "" if f.kind == "wrong_rig" else f.remedy)))
    return Fault(f.kind, f.channel, float("nan"), detail, f.value, f.unit)
