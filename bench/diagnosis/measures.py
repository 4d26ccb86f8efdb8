"""The required measures over many outcomes, a table for each effect, and the confusion matrix."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from independent.hidden import BESIDE_THE_CONTRACT, CATALOGUE

from bench.diagnosis.outcome import OUTSIDE, Outcome
from rsea_ros.diagnosis.settings import DEFAULT

HIDDEN = ("single", "newer", "pair", "drawn_pair", "drawn_triple")
NAMES = tuple(dict.fromkeys((*CATALOGUE, *BESIDE_THE_CONTRACT)))
"""Effects that the second bench can hide."""
NOTHING, UNEXPLAINED, OFF = "nothing wrong", "unexplained", "not in the catalogue"


@dataclass(frozen=True)
class Measure:
    """One line of the summary: name, value, number of cases, and the required value."""

    what: str
    value: float
    cases: int
    asked: str
    met: bool

    def __str__(self) -> str:
        mark = "ok  " if self.met else "LESS"
        return f"{mark} {self.what:<66}{self.value:8.2f}   required {self.asked:<10} ({self.cases} values)"


def measures(outcomes: Sequence[Outcome]) -> list[Measure]:
    """Return the issue's measures, in the issue's order; one without a case is left out."""
    sizes = [f for o in outcomes if o.group in HIDDEN for f in o.found if f.main]
    ended = [o for o in outcomes if o.group in (*HIDDEN, "clean") and not o.error]
    floor = DEFAULT.floor.reached
    groups = {name: [o for o in outcomes if o.group == name] for name in {o.group for o in outcomes}}
    lines = [
        _at_least("first cause right, one effect, %", _right(groups.get("single", ())), 97.0),
        _at_least(
            "first cause right or confusable with the right one, one effect, %",
            _lenient(groups.get("single", ())),
            97.0,
        ),
        _at_least("first cause right, one of the newer effects, %", _right(groups.get("newer", ())), 97.0),
        _at_least("both causes right, two effects, %", _right(groups.get("pair", ())), 90.0),
        _at_least("both causes right, two drawn at random, %", _right(groups.get("drawn_pair", ())), 90.0),
        _at_least("all causes right, three drawn at random, %", _right(groups.get("drawn_triple", ())), 90.0),
        _at_least("verdict nothing_wrong for a clean bench, %", _right(groups.get("clean", ())), 98.0),
        _at_least(
            "unexplained, effect outside the catalogue, %", _right(groups.get("off_catalogue", ())), 90.0
        ),
        _at_least(
            "unexplained or a look-alike, effect outside the catalogue, %",
            _lenient(groups.get("off_catalogue", ())),
            90.0,
        ),
        _at_least(
            "unexplained, effect removed from the catalogue, %", _right(groups.get("taken_out", ())), 90.0
        ),
        _at_least(
            "no name confirmed, effect outside the catalogue or removed, %",
            [
                "confirmed" not in o.statuses and not o.error
                for g in ("off_catalogue", "taken_out")
                for o in groups.get(g, ())
            ],
            95.0,
        ),
        _at_least("unexplained, effect that is not searched, %", _right(groups.get("unsearched", ())), 90.0),
        _at_least("fault found and cause right, faulty data, %", _right(groups.get("faulty", ())), 90.0),
        _at_most("main parameter, median error, %", [100.0 * f.error for f in sizes], 3.0),
        _at_least("main parameter within 10 %, %", [f.error <= 0.1 for f in sizes], 100.0),
        _at_least("main parameter in its 95 % interval, %", [f.covered for f in sizes], 90.0),
        _at_least("held-out residual at the noise floor, %", [o.times_noise <= floor for o in ended], 95.0),
        _at_least(
            "residual on a fresh record at the noise floor, %",
            [o.times_noise_fresh <= floor for o in ended if isfinite(o.times_noise_fresh)],
            95.0,
        ),
        _at_least(
            "gain within 0.05 of that on a fresh record, %",
            [abs(o.gain - o.gain_fresh) <= 0.05 for o in ended if isfinite(o.gain_fresh)],
            100.0,
        ),
        _longest("longest time for a case, s", [o.seconds for o in outcomes], 30.0),
        _at_most("median time for a case, s", [o.seconds for o in outcomes], 30.0),
    ]
    return [line for line in lines if line.cases]


def _right(outcomes: Iterable[Outcome]) -> list[bool]:
    return [o.right for o in outcomes]


def _lenient(outcomes: Iterable[Outcome]) -> list[bool]:
    return [o.right_or_rival for o in outcomes]


def _at_least(what: str, hits: Sequence[bool], asked: float) -> Measure:
    share = 100.0 * float(np.mean(hits)) if hits else 0.0
    return Measure(what, share, len(hits), f">= {asked:g}", share >= asked)


def _at_most(what: str, values: Sequence[float], asked: float) -> Measure:
    median = float(np.median(values)) if values else 0.0
    return Measure(what, median, len(values), f"<= {asked:g}", median <= asked)


def _longest(what: str, values: Sequence[float], asked: float) -> Measure:
    longest = max(values, default=0.0)
    return Measure(what, longest, len(values), f"<= {asked:g}", longest <= asked)


def confusion(outcomes: Sequence[Outcome]) -> dict[str, Counter[str]]:
    """Return counts of the first cause named (columns) for each truth (rows); two effects count twice."""
    rows: dict[str, Counter[str]] = {}
    for o in outcomes:
        if o.group == "reading":
            continue
        truths = o.truth or ((OFF,) if o.group in OUTSIDE else (NOTHING,))
        for truth in truths:
            rows.setdefault(truth, Counter())[_answer(o, truth)] += 1
    order = (*NAMES, OFF, NOTHING)
    return {truth: rows[truth] for truth in order if truth in rows}


def _answer(outcome: Outcome, truth: str) -> str:
    if outcome.error:
        return "error"
    if truth in outcome.named[: max(len(outcome.truth), 1)]:
        return truth
    others = [name for name in outcome.named if name not in outcome.truth]
    if others:
        return others[0]
    return NOTHING if outcome.verdict == "nothing_wrong" else UNEXPLAINED


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return the measures and the matrix as Markdown: columns are numbered as the rows are."""
    matrix = confusion(outcomes)
    columns = [*NAMES, UNEXPLAINED, NOTHING]
    columns += ["error"] * any("error" in row for row in matrix.values())
    lines = ["| measure | value | required | values |", "|---|--:|--:|--:|"]
    lines += [f"| {m.what} | {m.value:.2f} | {m.asked} | {m.cases} |" for m in measures(outcomes)]
    heads = [str(k + 1) if name in NAMES else name for k, name in enumerate(columns)]
    lines += ["", f"| truth (rows), first cause named (columns) | {' | '.join(heads)} |"]
    lines.append("|---|" + "--:|" * len(columns))
    for truth, row in matrix.items():
        number = f"{columns.index(truth) + 1} " if truth in NAMES else ""
        cells = [_cell(row[name], name == truth) for name in columns]
        lines.append(f"| {number}`{truth}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(count: int, right: bool) -> str:
    return f"**{count}**" if right and count else str(count or "")
