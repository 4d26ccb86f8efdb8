"""A record of known cause, diagnosed: what is said beside the truth, as a line of JSON."""

import hashlib
import json
import math
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from bench.results import resumed
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import CauseParameter, Diagnosis
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.errors import RseaError
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record
from rsea_ros.records.statistics import Z95

OUTSIDE = ("off_catalogue", "taken_out", "unsearched")
"""Groups whose effect the diagnosis does not have, or does not try unless a rig states it."""
PERIODIC = ("phase", "cycles_per_revolution")
"""Parameters with several values that mean the same."""
DOUBTED = ", the simulation's own error included"
Line = Mapping[str, Any]


class Played(NamedTuple):
    """A record, its rig, effects that the diagnosis may not use, and the causes in it (None: not known).

    sizes: true parameters of effects, in SI. values: true values of the rig. fresh: another record of the
    same machine. about: what the line tells of it; `faults`: of the data, put in.
    """

    record: Record
    rig: Rig
    without: tuple[str, ...] = ()
    truth: tuple[str, ...] | None = None
    sizes: Mapping[str, Mapping[str, float]] = {}
    values: Mapping[str, float] = {}
    fresh: Record | None = None
    about: Mapping[str, Any] = {}


class Entry(NamedTuple):
    """A record by its name and how it is made, so that only one is in memory."""

    name: str
    make: Callable[[], Played]


def play(name: str, played: Played, settings: DiagnosisSettings = DEFAULT) -> dict[str, Any]:
    """Diagnose a record and return its line; an error is its verdict."""
    line = {"record": name, "truth": played.truth, **played.about}
    begin, clock = time.perf_counter(), time.process_time()
    try:
        settings = replace(settings, without=played.without)
        result = diagnose([played.record], played.rig, settings=settings)
    except Exception as error:
        line |= {"verdict": f"error: {error}", "causes": [], "digest": "", "remarks": [], "faults_found": []}
        line |= {} if isinstance(error, RseaError) else {"traceback": traceback.format_exc(limit=-3)}
    else:
        line |= _told(result)
        line |= _beside_truth(result, played)
    processor, seconds = time.process_time() - clock, time.perf_counter() - begin
    return line | {"seconds": round(seconds, 1), "processor": round(processor, 1)}


def play_entry(entry: Entry, settings: DiagnosisSettings = DEFAULT) -> dict[str, Any]:
    """Make a record where it is played, and diagnose it."""
    return play(entry.name, entry.make(), settings)


def play_all(
    entries: Iterable[Entry], log: Path | None, settings: DiagnosisSettings = DEFAULT,
    minutes: float = math.inf, jobs: int = 1,
) -> Iterator[str]:  # fmt: skip
    """Play the records that a log lacks, and append their lines; yield what is said of each.

    minutes: none is begun after that. jobs: processes.
    """
    works = ((entry.name, partial(play_entry, entry, settings)) for entry in entries)
    for line in resumed(log, works, "record", minutes, jobs):
        found = line.get("found", ())
        sizes = ", ".join(f"{name} {value:.4g} of {truth:.4g}" for _, name, truth, value, *_ in found)
        mark = "" if line["truth"] is None else "ok   " if is_right(line) else "not  "
        sizes = f" ({sizes})" if sizes else ""
        yield f"{mark}{line['record']}: {said(line)}{sizes}, {line['seconds']:.1f} s"


def _told(result: Diagnosis) -> dict[str, Any]:
    """Return what a diagnosis says: probabilities to 0.01, sizes to a tenth of their sigma, and a digest."""
    causes = [
        {"name": c.name, "status": c.status, "p": round(c.probability, 2),
         "sizes": {n: _size(p) for n, p in c.parameters.items()},
         "rivals": [a.name for a in result.alternatives if a.instead_of == c.name]}
        for c in result.causes
    ]  # fmt: skip
    exact = [result.verdict, *(
        [c.name, c.status, c.probability.hex(), *(p.value.hex() for p in c.parameters.values())]
        for c in result.causes
    )]  # fmt: skip
    return {
        "verdict": result.verdict, "causes": causes,
        "digest": hashlib.sha256(json.dumps(exact).encode()).hexdigest()[:12],
        "remarks": sorted({r.code for r in result.remarks}),
        "faults_found": sorted({fault.kind for fault in result.faults}),
        "confusable": list(result.causes[0].confusable_with) if result.causes else [],
        "left": _worst(result.residual_rms, result.noise_rms),
        "times_noise": _worst(result.extended_residual_rms, result.noise_rms),
    }  # fmt: skip


def _size(p: CauseParameter) -> list[float]:
    """Return a size, rounded to a tenth of its sigma, and that sigma."""
    sigma = (p.ci95[1] - p.ci95[0]) / (2.0 * Z95)
    if not math.isfinite(sigma) or sigma <= 0.0:
        return [float(f"{p.value:.6g}"), 0.0]
    digits = max(0, -math.floor(math.log10(0.1 * sigma)))
    return [round(p.value, digits), float(f"{sigma:.2g}")]


def _beside_truth(result: Diagnosis, played: Played) -> Iterator[tuple[str, Any]]:
    """Yield sizes beside their truth, and how the models do on a fresh record.

    found: effect, parameter, truth, value, low, high. z: sigmas from the truth, where it alone is named.
    gain: 1 - RMS with the causes over RMS without, held out, and on the fresh record.
    """
    yield "found", [
        [c.name, n, truth, c.parameters[n].value, *c.parameters[n].ci95]
        for c in result.causes
        for n, truth in played.sizes.get(c.name, {}).items()
        if n in c.parameters
    ]
    if played.values and [c.name for c in result.causes] == list(played.truth or ()):
        yield "z", z_scores(result, played)
    if played.fresh is not None:
        before, after = (_errors(rig, played.fresh) for rig in (result.baseline_rig, result.extended_rig))
        yield "times_noise_fresh", _worst(after, result.noise_rms)
        if result.causes:
            channel = result.causes[0].channel
            of_channel = (1.0 - c.gain_holdout for c in result.causes if c.channel == channel)
            yield "gain", 1.0 - math.prod(of_channel)
            yield "gain_fresh", 1.0 - after[channel] / before[channel] if channel in before else math.nan


def _errors(rig: Rig, record: Record) -> dict[str, float]:
    return {k: v.rms_error for k, v in predict(rig, record).items()}


def _worst(residual: Mapping[str, float], noise: Mapping[str, float]) -> float:
    return max((residual[k] / noise[k] for k in residual if noise.get(k)), default=0.0)


def z_scores(result: Diagnosis, played: Played) -> dict[str, float]:
    """Return how many sigmas each value of the rig and of the causes lies from its truth."""
    quantities = result.extended_rig.quantities
    intervals = {name: (quantities[name].value, quantities[name].ci95) for name in played.values}
    true = dict(played.values)
    for cause in result.causes:
        true |= played.sizes[cause.name]
        for name, e in cause.parameters.items():
            intervals[name] = (e.value, e.statistical_ci95)
            intervals[f"{name}{DOUBTED}"] = (e.value, e.ci95)
    return {
        name: (value - true[of]) / ((ci95[1] - ci95[0]) / (2.0 * Z95))
        for name, (value, ci95) in intervals.items()
        if (of := name.removesuffix(DOUBTED)) in true and of not in PERIODIC
        if ci95 is not None and ci95[0] < ci95[1]
    }


def names_of(line: Line) -> list[str]:
    """Return the names that a line has, in their order."""
    return [c["name"] for c in line["causes"]]


def confirmed_of(line: Line) -> set[str]:
    """Return the names that a line has as sure."""
    return {c["name"] for c in line["causes"] if c["status"] == "confirmed"}


def said(line: Line) -> str:
    """Return verdict, names and statuses of a line."""
    names = ", ".join(f"{c['name']} ({c['status']})" for c in line["causes"])
    return f"{line['verdict']}: {names or 'no cause'}"


class Verdict(NamedTuple):
    """Beside the truth: names that are missed and wrong, wrong ones told as sure, and whether all is sure."""

    missed: frozenset[str]
    wrong: frozenset[str]
    surely_wrong: frozenset[str]
    sure: bool


def verdict_on(line: Line) -> Verdict:
    """Return what a line names beside its truth; an effect that the diagnosis lacks is none of it."""
    hidden = frozenset(() if line.get("group") in OUTSIDE else line["truth"] or ())
    named, confirmed = frozenset(names_of(line)), frozenset(confirmed_of(line))
    return Verdict(hidden - named, named - hidden, confirmed - hidden, confirmed == hidden)


def is_error(line: Line) -> bool:
    """Return whether the diagnosis of a line ended by an error."""
    return str(line["verdict"]).startswith("error")


def is_right(line: Line) -> bool:
    """Tell whether the first cause is the hidden one, several in any order, none for none, and the fault."""
    named, group = names_of(line), line.get("group", "")
    if is_error(line) or not set(line.get("faults", ())) <= set(line["faults_found"]):
        return False
    if group == "clean":
        return not named and line["verdict"] == "nothing_wrong"
    if group in OUTSIDE:
        return not named and (line["verdict"] != "nothing_wrong" or bool(line["faults_found"]))
    return set(named[: max(len(line["truth"]), 1)]) == set(line["truth"])


def is_right_or_rival(line: Line) -> bool:
    """The same, when a cause that the first is said to be confusable with counts as well."""
    if is_right(line) or is_error(line):
        return is_right(line)
    truth, named = line["truth"], names_of(line)
    mimic = line.get("group") in OUTSIDE and set(named) <= set(line.get("mimics", ()))
    return mimic or (len(truth) == 1 and truth[0] in named[:1] + line["confusable"])
