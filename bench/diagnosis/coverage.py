"""Which effects are found, by kind of work and by severity, on a plant that shares no code with the project.

    python -m bench diagnosis coverage play --log coverage.jsonl [--severity medium] [--sample 60]     resumes
    python -m bench diagnosis coverage table --log coverage.jsonl

A cell counts where its effect shows: where the rig alone, fitted, leaves more than the noise in some channel.
Found: the effect is named, alone or among the rivals of a cause.
Where it alone is named, z = (estimate - truth) / sigma of its parameters and of the rig's values says whether
the intervals after a diagnosis are honest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from independent.severities import SEVERITIES, SIZES

from bench.diagnosis.coverage_cases import COMMANDS, RIG_VALUES, make_record
from bench.diagnosis.played import DOUBTED, Line, confirmed_of, is_error, names_of, play, said
from bench.results import read_lines, resumed
from rsea_ros.records.statistics import Z95

SHOWS = 1.1
"""Residual of the fitted rig over the noise from which an effect shows."""
MARKS = {"named": "+", "rival": "r", "other": "x", "none": "-", "hidden": ".", "error": "E"}


def main(
    step: Annotated[str, ("play", "table")], *, log: Path,
    severity: Annotated[tuple[str, ...], SEVERITIES] = SEVERITIES,
    work: Annotated[tuple[str, ...], COMMANDS] = tuple(COMMANDS),
    effect: Annotated[tuple[str, ...], SIZES] = tuple(SIZES),
    sample: int = 0, seed: int = 5, duration: float = 20.0,
) -> None:  # fmt: skip
    """Play the cells that the log lacks, or print the outcomes by cell.

    log: JSON lines, a cell each
    sample: at most so many cells, drawn by the seed
    seed: of records
    duration: of records, s
    """
    if step == "table":
        return _print_table(read_lines(log))
    cells = list(product(effect, work, severity))
    order = np.random.default_rng(seed).permutation(len(cells))[: sample or None]
    named = {f"{'/'.join(cells[k])}/{seed}/{duration:g}": cells[k] for k in order}
    works = ((name, partial(_line, name, *cell, seed, duration)) for name, cell in named.items())
    for line in resumed(log, works, "record"):
        print(f"{judge(line):<7}{line['record']:<55}{said(line)} {line['seconds']:.0f} s", flush=True)


def _line(name: str, effect: str, work: str, severity: str, seed: int, duration: float) -> dict[str, Any]:
    return play(name, make_record(effect, work, severity, seed, duration))


def judge(line: Line) -> str:
    """Return the outcome of a cell, a key of MARKS."""
    (effect,) = line["truth"]
    if is_error(line):
        return "error"
    if effect in names_of(line):
        return "named"
    if any(effect in c["rivals"] for c in line["causes"]):
        return "rival"
    return "other" if line["causes"] else "hidden" if line["left"] <= SHOWS else "none"


def _print_table(lines: Sequence[Line]) -> None:
    by_cell: dict[tuple[str, str, str], list[str]] = {}
    for line in lines:
        effect, work, severity, *_ = line["record"].split("/")
        by_cell.setdefault((effect, work, severity), []).append(judge(line))
    print("| effect | " + " | ".join(COMMANDS) + " |\n|---|" + "---|" * len(COMMANDS))
    for effect in SIZES:
        marks = (
            " ".join("".join(MARKS[o] for o in by_cell.get((effect, work, s), ())) or " " for s in SEVERITIES)
            for work in COMMANDS
        )
        print(f"| {effect} | " + " | ".join(marks) + " |")
    outcomes = [judge(line) for line in lines]
    showing = len(lines) - outcomes.count("hidden")
    found = outcomes.count("named") + outcomes.count("rival")
    wrong = sum(not confirmed_of(line) <= set(line["truth"]) for line in lines)
    print(f"\nmild, medium, strong; {', '.join(f'{m} {o}' for o, m in MARKS.items())}")
    print(f"found {found} of {showing} that show ({len(lines)} played): {found / max(showing, 1):.1%}; "
          f"wrong and confirmed: {wrong}")  # fmt: skip
    _print_z_scores([line["z"] for line in lines if line.get("z")])


def _print_z_scores(scored: Sequence[Mapping[str, float]]) -> None:
    """Print the RMS of z of each value of the rig, of the causes' parameters, and of all."""
    groups: dict[str, list[float]] = {}
    for name, z in (item for scores in scored for item in scores.items()):
        of_cause = "causes" + DOUBTED * name.endswith(DOUBTED)
        groups.setdefault(name if name in RIG_VALUES else of_cause, []).append(z)
    groups["all of the noise alone"] = [z for s in scored for n, z in s.items() if not n.endswith(DOUBTED)]
    print(f"\n| z over {len(scored)} records | values | RMS | median of abs(z) / 0.674 | abs(z) < 1.96, % |")
    print("|---|--:|--:|--:|--:|")
    for name, group in groups.items():
        size = np.abs(group)
        print(
            f"| {name} | {len(group)} | {np.sqrt(np.mean(size**2)):.2f} | {np.median(size) / 0.6745:.2f} "
            f"| {100.0 * np.mean(size < Z95):.0f} |"
        )
