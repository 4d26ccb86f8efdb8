"""Measure the diagnosis on records of known cause: the issue's measures, a confusion matrix, every case."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
from independent.hidden import BESIDE_THE_CONTRACT, CATALOGUE, MAIN_PARAMETER

from bench.diagnosis import played
from bench.diagnosis.cases import RIG_VALUES, plan, shared_records
from bench.diagnosis.played import DOUBTED, Entry, Line, confirmed_of, is_error, names_of, play_all
from bench.results import Row, read_lines
from rsea_ros.diagnosis.settings import DEFAULT

HIDDEN = ("single", "newer", "pair", "drawn_pair", "drawn_triple")
NAMES = tuple(dict.fromkeys((*CATALOGUE, *BESIDE_THE_CONTRACT)))
"""Effects that the second bench can hide."""
NOTHING, UNEXPLAINED, OFF = "nothing wrong", "unexplained", "not in the catalogue"
FLOOR = DEFAULT.floor.reached
Values = Callable[[Sequence[Line]], Sequence[float]]


def of_group(*groups: str, when: Callable[[Line], bool] = played.is_right) -> Values:
    """Return what tells of each line of some groups whether something holds."""
    return lambda lines: [float(when(x)) for x in lines if x.get("group") in groups]


def of_sizes(value: Callable[[float, float, float, float], float]) -> Values:
    """Return what tells something of each main parameter, of truth, value, low and high."""
    return lambda lines: [
        value(*numbers)
        for x in lines if x.get("group") in HIDDEN
        for effect, name, *numbers in x.get("found", ())
        if name == (MAIN_PARAMETER.get(effect) or next(iter(BESIDE_THE_CONTRACT[effect][0])))
    ]  # fmt: skip


def of_ended(key: str, value: Callable[[Line], float]) -> Values:
    """Return what tells something of each line whose effects the catalogue has, where the line has a key."""
    groups = (*HIDDEN, "clean")
    return lambda lines: [
        float(value(x)) for x in lines
        if x.get("group") in groups and not is_error(x) and np.isfinite(x.get(key, np.nan))
    ]  # fmt: skip


def of_z(of_rig: bool) -> Values:
    """Return what tells the sigmas from the truth of the rig's values or of sizes, names right."""
    return lambda lines: [
        z for x in lines if x.get("group") in HIDDEN
        for name, z in x.get("z", {}).items() if not name.endswith(DOUBTED) and (name in RIG_VALUES) == of_rig
    ]  # fmt: skip


def _error(truth: float, value: float, *_: float) -> float:
    """Return the error of a size relative to the truth; absolute where the truth is zero."""
    return abs(value - truth) / (abs(truth) or 1.0)


def _share(values: Sequence[float]) -> float:
    return 100.0 * float(np.mean(values))


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


MEASURES: Sequence[tuple[str, Values, Callable[[Sequence[float]], float], str]] = (
    ("first cause right, one effect, %", of_group("single"), _share, ">= 97"),
    ("first cause right or confusable with the right one, one effect, %",
     of_group("single", when=played.is_right_or_rival), _share, ">= 97"),
    ("first cause right, one of the newer effects, %", of_group("newer"), _share, ">= 97"),
    ("both causes right, two effects, %", of_group("pair"), _share, ">= 90"),
    ("both causes right, two drawn at random, %", of_group("drawn_pair"), _share, ">= 90"),
    ("all causes right, three drawn at random, %", of_group("drawn_triple"), _share, ">= 90"),
    ("verdict nothing_wrong for a clean bench, %", of_group("clean"), _share, ">= 98"),
    ("unexplained, effect outside the catalogue, %", of_group("off_catalogue"), _share, ">= 90"),
    ("unexplained or a look-alike, effect outside the catalogue, %",
     of_group("off_catalogue", when=played.is_right_or_rival), _share, ">= 90"),
    ("unexplained, effect removed from the catalogue, %", of_group("taken_out"), _share, ">= 90"),
    ("no name confirmed, effect outside the catalogue or removed, %",
     of_group("off_catalogue", "taken_out", when=lambda x: not confirmed_of(x) and not is_error(x)),
     _share, ">= 95"),
    ("unexplained, effect that is not searched, %", of_group("unsearched"), _share, ">= 90"),
    ("fault found and cause right, faulty data, %", of_group("faulty"), _share, ">= 90"),
    ("main parameter, median error, %", of_sizes(lambda *n: 100.0 * _error(*n)), _median, "<= 3"),
    ("main parameter within 10 %, %", of_sizes(lambda *n: _error(*n) <= 0.1), _share, ">= 100"),
    ("main parameter in its 95 % interval, %", of_sizes(lambda t, _, low, high: low <= t <= high),
     _share, ">= 90"),
    ("z of the rig's values, RMS", of_z(True), _rms, "0.8 to 1.3"),
    ("z of the causes' sizes, RMS", of_z(False), _rms, "0.8 to 1.3"),
    ("held-out residual at the noise floor, %",
     of_ended("times_noise", lambda x: x["times_noise"] <= FLOOR), _share, ">= 95"),
    ("residual on a fresh record at the noise floor, %",
     of_ended("times_noise_fresh", lambda x: x["times_noise_fresh"] <= FLOOR), _share, ">= 95"),
    ("gain within 0.05 of that on a fresh record, %",
     of_ended("gain_fresh", lambda x: abs(x["gain"] - x["gain_fresh"]) <= 0.05), _share, ">= 100"),
    ("longest time for a case, s", lambda lines: [x["seconds"] for x in lines], max, "<= 30"),
    ("median time for a case, s", lambda lines: [x["seconds"] for x in lines], _median, "<= 30"),
)  # fmt: skip
"""What is measured, of which values, how, and what is required; one without a value is left out."""


def confusion(lines: Sequence[Line]) -> dict[str, Counter[str]]:
    """Return counts of the first cause named (columns) for each truth (rows); two effects count twice."""
    rows: dict[str, Counter[str]] = {}
    for line in (x for x in lines if x.get("group") != "reading"):
        outside = line.get("group") in played.OUTSIDE
        for truth in (OFF,) if outside else line["truth"] or (NOTHING,):
            rows.setdefault(truth, Counter())[_answer(line, truth)] += 1
    return {truth: rows[truth] for truth in (*NAMES, OFF, NOTHING) if truth in rows}


def _answer(line: Line, truth: str) -> str:
    hidden: Any = () if line.get("group") in played.OUTSIDE else line["truth"]
    named = names_of(line)
    if is_error(line):
        return "error"
    if truth in named[: max(len(hidden), 1)]:
        return truth
    others = [name for name in named if name not in hidden]
    return others[0] if others else NOTHING if line["verdict"] == "nothing_wrong" else UNEXPLAINED


def main(
    *, cases: Annotated[str, ("shared", "own", "all")] = "all", select: str = "", limit: int = 0,
    seed: int = 2024, jobs: int = 1, log: Path | None = None,
) -> Iterator[Row | str]:  # fmt: skip
    """Run the cases that the log lacks, print each line when it arrives and the summary at the end.

    cases: which records
    select: only cases with this text in name or group
    limit: only so many, spread evenly over all
    seed: of the cases
    jobs: cases at a time
    log: JSON lines, a case each
    """
    works = list(shared_records()) if cases != "own" else []
    works = [entry for entry in works if select in entry.name]
    own = plan(seed) if cases != "shared" else ()
    works += [Entry(p.name, p.make) for p in own if select in f"{p.name} {p.group}"]
    count = min(limit or len(works), len(works))
    with TemporaryDirectory() as folder:
        lines = log or Path(folder) / "lines.jsonl"
        yield from play_all([works[k * len(works) // count] for k in range(count)], lines, jobs=jobs)
        yield from _rows(read_lines(lines))


def _rows(lines: Sequence[Line]) -> Iterator[Row]:
    """Yield the measures and the matrix: columns are numbered as the rows are."""
    for what, values, statistic, asked in MEASURES:
        if each := values(lines):
            yield Row(what, asked, {"value": f"{statistic(each):.2f}", "values": str(len(each))})
    matrix = confusion(lines)
    columns = [*NAMES, UNEXPLAINED, NOTHING]
    columns += ["error"] * any("error" in row for row in matrix.values())
    heads = [str(k + 1) if name in NAMES else name for k, name in enumerate(columns)]
    for truth, row in matrix.items():
        number = f"{columns.index(truth) + 1} " if truth in NAMES else ""
        counts = {name: str(row[name] or "") for name in columns}
        counts |= {truth: f"**{row[truth]}**"} if row[truth] else {}
        cells = dict(zip(heads, (counts[name] for name in columns), strict=True))
        yield Row(f"{number}`{truth}`", "", cells)
