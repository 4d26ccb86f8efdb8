"""Which effects are found, by kind of work and by severity, on a plant that shares no code with the project.

    python -m bench diagnosis coverage play --log coverage.jsonl [--severity medium] [--sample 60]     resumes
    python -m bench diagnosis coverage table --log coverage.jsonl

A cell counts where its effect shows: where the rig alone, fitted, leaves more than the noise in some channel.
Found: the effect is named, alone or among the rivals of a cause.
Where it alone is named, z = (estimate - truth) / sigma of its parameters and of the rig's values says whether
the intervals after a diagnosis are honest.
"""

from __future__ import annotations

import argparse
import time
import traceback
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from independent.severities import SEVERITIES, SIZES

from bench import parser_of
from bench.diagnosis.coverage_cases import COMMANDS, RIG_VALUES, Made, make_record
from bench.results import append_line, read_lines
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.statistics import Z95

PERIODIC = ("phase", "cycles_per_revolution")
"""Parameters with several values that mean the same."""
DOUBTED = ", the simulation's own error included"
SHOWS = 1.1
"""Residual of the fitted rig over the noise from which an effect shows."""
MARKS = {"named": "+", "rival": "r", "other": "x", "none": "-", "hidden": ".", "error": "E"}


def main(argv: Sequence[str]) -> int:
    """Play cells or print their table."""
    args = _parser().parse_args(argv)
    return int(args.step(args) or 0)


def _parser() -> argparse.ArgumentParser:
    parser = parser_of(__doc__)
    verbs = parser.add_subparsers(required=True, metavar="play|table")
    play = verbs.add_parser("play", help="diagnose cells that the log does not hold")
    play.add_argument("--severity", choices=SEVERITIES, action="append", help="by default all")
    play.add_argument("--work", choices=COMMANDS, action="append", help="by default all")
    play.add_argument("--effect", choices=SIZES, action="append", help="by default all")
    play.add_argument("--sample", type=int, help="at most N cells, drawn by the seed")
    play.add_argument("--seed", type=int, default=5, help="of records (default %(default)s)")
    play.add_argument("--duration", type=float, default=20.0, help="of records, s (default %(default)s)")
    play.set_defaults(step=_play)
    table = verbs.add_parser("table", help="the outcomes by cell")
    table.set_defaults(step=_table)
    for verb in (play, table):
        verb.add_argument("--log", type=Path, required=True, help="JSON lines, a cell each")
    return parser


def _play(args: argparse.Namespace) -> None:
    done = {entry["cell"] for entry in read_lines(args.log)}
    cells = list(product(args.effect or SIZES, args.work or COMMANDS, args.severity or SEVERITIES))
    order = np.random.default_rng(args.seed).permutation(len(cells))[: args.sample]
    for effect, work, severity in (cells[k] for k in order):
        cell = f"{effect}/{work}/{severity}/{args.seed}/{args.duration:g}"
        if cell in done:
            continue
        entry = {"cell": cell, "effect": effect, "work": work, "severity": severity}
        entry |= _outcome(effect, work, severity, args)
        append_line(args.log, entry)
        named = [f"{c['name']} {c['status']} {c['probability']:.2f}" for c in entry.get("causes", [])]
        print(f"{entry['outcome']:<7}{cell:<55}{', '.join(named)} {entry['seconds']:.0f} s", flush=True)


def _outcome(effect: str, work: str, severity: str, args: argparse.Namespace) -> dict[str, Any]:
    start = time.perf_counter()
    try:
        truth = make_record(effect, work, severity, args.seed, args.duration)
        result = diagnose([truth.record], load_rig("paper_high_impedance"))
    except Exception:
        return {"outcome": "error", "error": traceback.format_exc(limit=-3), "seconds": 0.0}
    causes = [
        {
            "name": c.name,
            "status": c.status,
            "probability": c.probability,
            "rivals": [a.name for a in result.alternatives if a.instead_of == c.name],
        }
        for c in result.causes
    ]
    left = max((result.residual_rms[k] / n for k, n in result.noise_rms.items() if n), default=0.0)
    return {
        "outcome": _judge(effect, causes, left),
        "causes": causes,
        "left": left,
        "verdict": result.verdict,
        "parameters": dict(truth.parameters),
        "z": z_scores(result, truth) if [c["name"] for c in causes] == [effect] else {},
        "seconds": round(time.perf_counter() - start, 1),
    }


def z_scores(result: Diagnosis, truth: Made) -> dict[str, float]:
    """Return how many sigmas each value of the rig and of the cause lies from its truth."""
    (cause,) = result.causes
    quantities = result.extended_rig.quantities
    intervals = {name: (quantities[name].value, quantities[name].ci95) for name in truth.rig}
    for name, e in cause.parameters.items():
        intervals[name] = (e.value, e.statistical_ci95)
        intervals[f"{name}{DOUBTED}"] = (e.value, e.ci95)
    true = {**truth.rig, **truth.parameters}
    return {
        name: (value - true[of]) / ((ci95[1] - ci95[0]) / (2.0 * Z95))
        for name, (value, ci95) in intervals.items()
        if (of := name.removesuffix(DOUBTED)) in true and of not in PERIODIC
        if ci95 is not None and ci95[0] < ci95[1]
    }


def _judge(effect: str, causes: Sequence[dict[str, Any]], left: float) -> str:
    """Return the outcome of a cell, a key of MARKS."""
    if any(c["name"] == effect for c in causes):
        return "named"
    if any(effect in c["rivals"] for c in causes):
        return "rival"
    if left <= SHOWS and not causes:
        return "hidden"
    return "other" if causes else "none"


def _table(args: argparse.Namespace) -> None:
    entries = read_lines(args.log)
    by_cell: dict[tuple[str, str, str], list[str]] = {}
    for entry in entries:
        by_cell.setdefault((entry["effect"], entry["work"], entry["severity"]), []).append(entry["outcome"])
    print("| effect | " + " | ".join(COMMANDS) + " |\n|---|" + "---|" * len(COMMANDS))
    for effect in SIZES:
        marks = (
            " ".join("".join(MARKS[o] for o in by_cell.get((effect, work, s), ())) or " " for s in SEVERITIES)
            for work in COMMANDS
        )
        print(f"| {effect} | " + " | ".join(marks) + " |")
    showing = [e for e in entries if e["outcome"] != "hidden"]
    decided = [e for e in showing if e["outcome"] in ("named", "rival")]
    wrong = [e for e in entries if _is_surely_wrong(e)]
    print(f"\nmild, medium, strong; {', '.join(f'{m} {o}' for o, m in MARKS.items())}")
    print(f"found {len(decided)} of {len(showing)} that show ({len(entries)} played): ", end="")
    print(f"{len(decided) / max(len(showing), 1):.1%}; wrong and confirmed: {len(wrong)}")
    _print_z_scores(entries)


def _print_z_scores(entries: Sequence[dict[str, Any]]) -> None:
    """Print the RMS of z of each value of the rig, of the causes' parameters, and of all."""
    scored = [e["z"] for e in entries if e.get("z")]
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


def _is_surely_wrong(entry: dict[str, Any]) -> bool:
    return any(c["status"] == "confirmed" and c["name"] != entry["effect"] for c in entry.get("causes", []))
