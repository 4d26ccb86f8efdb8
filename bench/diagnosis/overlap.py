"""Several small effects at once on a plant that shares no code with the project: named, missed, and false.

    python -m bench diagnosis overlap play --log overlap.jsonl [--records 10] [--hidden 4]     resumes
    python -m bench diagnosis overlap score --log overlap.jsonl

Each effect is mild to medium (test/independent/severities.py), of another mechanism than the others: two
frictions in one gear would be one law. Named: with any status, or as a rival of a named cause. False: a cause
with status `confirmed` that is not hidden. One that hides below the noise counts as missed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.hidden import hide
from independent.severities import drawn_parameters

from bench.diagnosis.cases import RIG
from bench.diagnosis.coverage_cases import COMMANDS
from bench.diagnosis.played import Line, Played, confirmed_of, names_of, play, said
from bench.results import read_lines, resumed
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.model.rig_file import load_rig

MECHANISMS = (
    ("coulomb_friction", "asymmetric_friction", "load_dependent_friction"),
    ("nonlinear_spring", "spring_hysteresis", "stiffness_drift"),
    ("command_delay", "current_loop_lag", "torque_constant_error"),
    ("ft_drift", "mains_interference", "structural_resonance"),
    ("torque_ripple", "damping_drift"),
)
FURTHER = (("backlash",), ("torque_saturation",))
"""Mechanisms of which records draw too that hide more than five effects."""
DURATION = 25.0
WORK = ("chirp", "multisine", "work")


def main(
    step: Annotated[str, ("play", "score")], *, log: Path, records: int = 10, hidden: int = 4,
    max_causes: int = 6,
) -> None:  # fmt: skip
    """Play records or score them.

    log: JSON lines, a record each
    records: seeds from 0 on
    hidden: effects in a record
    max_causes: of the search
    """
    if step == "score":
        return print("\n".join(score_text(read_lines(log))))
    settings = DiagnosisSettings(max_causes)
    works = ((str(k), partial(_line, k, hidden, settings)) for k in range(records))
    for line in resumed(log, works, "record"):
        print(line["record"], ", ".join(line["truth"]), said(line), flush=True)


def make_record(seed: int, number: int) -> Played:
    """Return a record with a number of effects hidden in it."""
    rng = np.random.default_rng([12, seed])
    mechanisms = MECHANISMS if number <= len(MECHANISMS) else (*MECHANISMS, *FURTHER)
    groups = rng.permutation(len(mechanisms))[:number]
    names = [str(rng.choice(mechanisms[k])) for k in sorted(groups)]
    hidden = {n: drawn_parameters(n, str(rng.choice(("mild", "medium"))), rng) for n in names}
    bench = drawn_bench(rng)
    for name, parameters in hidden.items():
        bench = hide(bench, name, parameters)
    work = WORK[seed % len(WORK)]
    record = record_command(bench, COMMANDS[work](bench, DURATION, rng), rng)
    return Played(record, load_rig(RIG), (), tuple(hidden), hidden, about={"work": work})


def _line(seed: int, number: int, settings: DiagnosisSettings) -> dict[str, Any]:
    return play(str(seed), make_record(seed, number), settings)


def score_text(lines: Sequence[Line]) -> Iterator[str]:
    """Yield a row for each record, hidden effects with their status and what else was said; then shares."""
    yield "| seed | work | hidden: status | other causes: status | verdict |\n|--:|---|---|---|---|"
    found = every = causes = 0
    for line in lines:
        told = {c["name"]: c["status"] for c in line["causes"]}
        told = dict.fromkeys((n for c in line["causes"] for n in c["rivals"]), "rival") | told
        found += sum(n in told for n in line["truth"])
        every, causes = every + len(line["truth"]), causes + len(line["causes"])
        hidden = ", ".join(f"{n}: {told.get(n, 'missed')}" for n in line["truth"])
        others = ", ".join(f"{n}: {told[n]}" for n in names_of(line) if n not in line["truth"])
        yield f"| {line['record']} | {line['work']} | {hidden} | {others} | {line['verdict']} |"
    false = sum(len(confirmed_of(line) - set(line["truth"])) for line in lines)
    seconds = float(np.median([line["processor"] for line in lines]))
    yield (f"\n{len(lines)} records: {found} of {every} hidden effects named ({found / max(every, 1):.0%}), "
           f"{false} of {causes} causes confirmed and false ({false / max(causes, 1):.0%}); "
           f"median {seconds:.0f} s of processor")  # fmt: skip
