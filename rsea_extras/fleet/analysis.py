"""One recording read and analysed."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from rsea_extras.fleet.joints import MappedJoint, date_in
from rsea_extras.fleet.store import Row
from rsea_ros import Record, Rig, RseaError
from rsea_ros.extension import recording as steps
from rsea_ros.extension.base import COMMANDS, UNITS, Fault, strict_yaml, with_unit
from rsea_ros.extension.page import result_files
from rsea_ros.extension.rigs import ROLES, rig_from_document, rig_text

_DATED_NS = 10**17
"""Stamps below (1973) count since a machine's start, not since 1970."""


@dataclass(frozen=True)
class JointRecording:
    """A recording of one joint. lenient: with gaps, repeats and NaN as they were recorded.

    strict: as a fit takes it; raises the error of a recording that it cannot take.
    """

    lenient: Record
    strict: Callable[[], Record]
    temperature: float | None
    time: datetime | None


def read_run(path: Path, url: str, joint: MappedJoint) -> JointRecording:
    """Read a recording. path: on this machine. Raises RseaError for one that cannot be read."""
    if joint.table is not None:
        record = steps.import_record(path, joint.table, joint.index)
        return JointRecording(record, lambda: record, None, time_of(record, url, joint.date))
    topics = joint.topics
    wanted = {steps.DIAGNOSTICS, *(topics.topic(role) for role in ROLES), joint.temperature}
    contents = steps.read_contents(path, wanted)
    record = steps.record_from(contents, url, topics, strict=False)
    return JointRecording(
        record,
        lambda: steps.record_from(contents, url, topics),
        steps.mean_temperature(contents, joint.temperature),
        time_of(record, url, joint.date),
    )


def time_of(record: Record, url: str, date: str) -> datetime | None:
    """Return when a recording began: by its stamps, else by the date in its path, else None."""
    if record.epoch_ns > _DATED_NS:
        return datetime.fromtimestamp(record.epoch_ns // 1000 * 1e-6, timezone.utc)
    return date_in(url, date) if date else None


_MAIN = ("ft", "deflection", "position", "velocity")
"""Channels that show how well a fit is; the first that a recording has stands in the row."""


def analyse(row: Row, path: Path, url: str, joint: MappedJoint, *, page: bool = False) -> dict[str, str]:
    """Fill a row from a recording, and return the artefacts by file name. page: with that of a diagnosis.

    The row keeps the results before an error. Raises RseaError for a recording that cannot be used.
    """
    rig = rig_from_document(strict_yaml.parse(joint.rig).content, default_name=joint.name)
    run = read_run(path, url, joint)
    record = run.lenient
    row |= {"time": run.time, "temperature": run.temperature, "duration": float(record.stop - record.start)}
    row |= {"excitation": excitation(record), "faults": faults(record.faults)}
    steps.check_pace(record)
    steps.require_motion(record)
    findings = steps.check_record(steps.bound_values(record), rig, joint.topics.axis)
    row["faults"] = faults(findings.faults)
    result = steps.identify([steps.with_faults(_fit_for_fit(run, rig), findings, masks=False)], rig)
    times = result.times_noise
    main = next((n for n in _MAIN if n in times), next(iter(times), ""))
    row |= {"verdict": result.verdict, "residual": result_files.strict(times.get(main, math.nan))}
    row["parameters"] = [_parameter(p) for p in result.parameters]
    files = {
        result_files.IDENTIFICATION_JSON: result_files.json_text(steps.identification_json(result)),
        result_files.MODEL: rig_text(result.rig),
    }
    if joint.diagnose == "always" or (joint.diagnose == "misfit" and result.verdict == "misfit"):
        files |= _diagnose(row, steps.with_faults(record, findings, masks=True), rig, page=page)
    return files


def _fit_for_fit(run: JointRecording, rig: Rig) -> Record:
    """Return the run without the samples that the checks mask."""
    checked = steps.check(steps.bound_values(run.lenient), rig)
    measured = [n for n in checked.record.channels if n not in COMMANDS]
    if not any(checked.masked[n].any() for n in measured if n in checked.masked):
        return run.strict()
    kept = {n: c if n not in measured else replace(c, t=c.t[~checked.masked[n]], y=c.y[~checked.masked[n]])
            for n, c in checked.record.channels.items()}  # fmt: skip
    return replace(checked.record, channels=kept)


def _diagnose(row: Row, record: Record, rig: Rig, *, page: bool) -> dict[str, str]:
    """Fill in the diagnosis, and return its artefacts; a failed one leaves its reason.

    The parameters become those beside the causes: a fit without them takes dry friction for damping and
    backlash for a softer spring, by an amount that depends on the day's work (docs/fleet-trends.md).
    """

    try:
        steps.check_diagnosable(record)
        result = steps.diagnose([record], rig)
    except RseaError as error:
        row["reason"] = f"no diagnosis: {error}"
        return {}
    parameters = [_parameter(p) for p in result.final]
    causes = [_cause(c) for c in result.causes]
    row |= {"diagnosis": result.verdict, "causes": causes, "parameters": parameters}
    files = {
        result_files.DIAGNOSIS_JSON: result_files.json_text(steps.diagnosis_json(result)),
        "extended.yaml": rig_text(result.extended_rig),
    }
    return files | ({result_files.REPORT: steps.diagnosis_report(result)} if page else {})


def _interval(name: str, estimate: Any) -> dict[str, Any]:
    low, high = map(result_files.strict, estimate.ci95)
    return {"name": name, **result_files.pick(estimate, "value unit"), "low": low, "high": high}


def _parameter(p: steps.ParameterEstimate) -> dict[str, Any]:
    return {**_interval(p.name, p), "identifiable": p.is_identifiable}


def _cause(cause: Any) -> dict[str, Any]:
    sizes = [_interval(name, size) for name, size in cause.parameters.items()]
    return {**result_files.pick(cause, "name status probability gain=gain_holdout"), "sizes": sizes}


def excitation(record: Record) -> list[dict[str, Any]]:
    """Return the excitation of the run: size and band of the command, and the travel of the output."""
    figures: list[tuple[str, float, str]] = []
    name = next((n for n in COMMANDS if n in record), "")
    if name:
        y = record[name].y[np.isfinite(record[name].y)]
        if len(y):
            unit = UNITS[name]
            figures += [("rms", float(np.std(y)), unit), ("peak", float(np.max(np.abs(y))), unit)]
        if name == "command" and len(y) == len(record[name]) > 2 and np.all(np.diff(record[name].t) > 0.0):
            low, high = steps.command_band(record["command"])
            figures += [("band_low", low, "Hz"), ("band_high", high, "Hz")]
    for channel, unit in (("position", "rad"), ("ft", "N m")):
        if channel in record and np.isfinite(record[channel].y).any():
            span = float(np.nanmax(record[channel].y) - np.nanmin(record[channel].y))
            figures.append((f"{channel}_span", span, unit))
    return [{"name": n, "value": result_files.strict(v), "unit": u} for n, v, u in figures]


def faults(listed: Iterable[Fault]) -> list[dict[str, Any]]:
    """Return faults of the data by kind, with how many of them and the first one's place."""
    every = list(dict.fromkeys(listed))
    counts = Counter(f.kind for f in every)
    first: Mapping[str, Fault] = {f.kind: f for f in reversed(every)}
    return [{"kind": kind, "count": n, "detail": _place(first[kind])} for kind, n in sorted(counts.items())]


def _place(fault: Fault) -> str:
    share = f"{100.0 * fault.share:.3g} %" if math.isfinite(fault.share) else ""
    size = with_unit(f"{fault.size:.4g}", fault.unit) if fault.size is not None else ""
    return ": ".join(filter(None, (fault.channel, ", ".join(filter(None, (share, size, fault.detail))))))
