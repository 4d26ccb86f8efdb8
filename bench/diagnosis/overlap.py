"""Several small effects at once on a plant that shares no code with the project: named, missed, and false.

    python -m bench diagnosis overlap play --log overlap.jsonl [--records 10] [--hidden 4]     resumes
    python -m bench diagnosis overlap score --log overlap.jsonl

Each effect is mild to medium (test/independent/severities.py), of another mechanism than the others: two
frictions in one gear would be one law. Named: with any status, or as a rival of a named cause. False: a cause
with status `confirmed` that is not hidden. One that hides below the noise counts as missed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.hidden import hide
from independent.severities import drawn_parameters

from bench import parser_of
from bench.diagnosis.coverage_cases import COMMANDS
from bench.results import append_line, read_lines
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record

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


def main(argv: Sequence[str]) -> int:
    """Play records or score them."""
    parser = parser_of(__doc__)
    parser.add_argument("step", choices=("play", "score"))
    parser.add_argument("--log", type=Path, required=True, help="JSON lines, a record each")
    parser.add_argument("--records", type=int, default=10, help="seeds from 0 on (default %(default)s)")
    parser.add_argument("--hidden", type=int, default=4, help="effects in a record (default %(default)s)")
    parser.add_argument("--max-causes", type=int, default=6, help="of the search (default %(default)s)")
    args = parser.parse_args(argv)
    if args.step == "play":
        _play(args.log, args.records, args.hidden, args.max_causes)
    else:
        entries = read_lines(args.log)
        print(table(entries), score_text(entries), sep="\n\n")
    return 0


def _play(log: Path, records: int, hidden: int, most: int) -> None:
    done = {entry["seed"] for entry in read_lines(log)}
    for seed in (s for s in range(records) if s not in done):
        entry = _outcome(seed, hidden, most)
        append_line(log, entry)
        print(entry, flush=True)


def make_record(seed: int, number: int) -> tuple[Record, Mapping[str, Mapping[str, float]], str]:
    """Return a record, the parameters of a number of effects hidden in it by name, and its kind of work."""
    rng = np.random.default_rng([12, seed])
    mechanisms = MECHANISMS if number <= len(MECHANISMS) else (*MECHANISMS, *FURTHER)
    groups = rng.permutation(len(mechanisms))[:number]
    names = [str(rng.choice(mechanisms[k])) for k in sorted(groups)]
    hidden = {n: drawn_parameters(n, str(rng.choice(("mild", "medium"))), rng) for n in names}
    bench = drawn_bench(rng)
    for name, parameters in hidden.items():
        bench = hide(bench, name, parameters)
    work = WORK[seed % len(WORK)]
    return record_command(bench, COMMANDS[work](bench, DURATION, rng), rng), hidden, work


def _outcome(seed: int, number: int, most: int) -> dict[str, Any]:
    record, hidden, work = make_record(seed, number)
    start = time.process_time()
    result = diagnose([record], load_rig("paper_high_impedance"), settings=DiagnosisSettings(most))
    rivals = [a.name for a in result.alternatives]
    causes = {c.name: c.status for c in result.causes}
    named = [n for n in hidden if n in causes or n in rivals]
    false = [n for n, status in causes.items() if n not in hidden and status == "confirmed"]
    return {
        "seed": seed,
        "work": work,
        "hidden": {n: dict(p) for n, p in hidden.items()},
        "causes": causes,
        "rivals": rivals,
        "named": named,
        "false": false,
        "verdict": result.verdict,
        "seconds": round(time.process_time() - start, 1),
    }


def table(entries: Sequence[Mapping[str, Any]]) -> str:
    """Return a row for each record: what is hidden in it with the status it got, and what else was said."""
    rows = [
        f"| {e['seed']} | {e['work']} | {', '.join(_name_causes(n, e) for n in e['hidden'])} "
        f"| {', '.join(_name_causes(n, e) for n in e['causes'] if n not in e['hidden'])} | {e['verdict']} |"
        for e in entries
    ]
    head = "| seed | work | hidden: status | other causes: status | verdict |\n|--:|---|---|---|---|"
    return "\n".join([head, *rows])


def _name_causes(name: str, entry: Mapping[str, Any]) -> str:
    as_rival = "rival" if name in entry["rivals"] else "missed"
    return f"{name}: {entry['causes'].get(name, as_rival)}"


def score_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """Return shares of hidden effects that were named and of said causes that are false."""
    hidden, named, said, false = (
        sum(len(e[k]) for e in entries) for k in ("hidden", "named", "causes", "false")
    )
    seconds = float(np.median([e["seconds"] for e in entries])) if entries else 0.0
    return (
        f"{len(entries)} records: {named} of {hidden} hidden effects named ({named / max(hidden, 1):.0%}), "
        f"{false} of {said} causes confirmed and false ({false / max(said, 1):.0%}); "
        f"median {seconds:.0f} s of processor"
    )
