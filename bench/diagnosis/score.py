"""Measure the diagnosis on records of known cause: the issue's measures, a confusion matrix, every case.

python -m bench diagnosis --cases all --json out/diagnosis.json
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import partial
from pathlib import Path

from bench import parser_of
from bench.diagnosis.cases import plan
from bench.diagnosis.measures import markdown, measures
from bench.diagnosis.outcome import Outcome, run_case
from bench.diagnosis.shared import SHARED, shared_cases


def main(argv: Sequence[str]) -> int:
    """Run the requested cases, print each outcome when it arrives and the summary at the end."""
    args = _parser().parse_args(argv)
    jobs = _jobs(args)
    outcomes = []
    for outcome in _run(jobs, args.jobs):
        outcomes.append(outcome)
        print(_line(outcome, len(outcomes), len(jobs)), flush=True)
        _write(args, outcomes)
    print(markdown(outcomes))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = parser_of(__doc__)
    parser.add_argument("--cases", choices=("shared", "own", "all"), default="all", help="which records")
    parser.add_argument("--select", default="", metavar="TEXT", help="only cases with TEXT in name or group")
    parser.add_argument("--limit", type=int, metavar="N", help="only N cases, spread evenly over all")
    parser.add_argument("--seed", type=int, default=2024, help="seed of the cases (default %(default)s)")
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="cases at a time (default %(default)s)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="all outcomes")
    return parser


def _jobs(args: argparse.Namespace) -> list[partial[Outcome]]:
    """Return a call for each case: simulated or read where it runs, so that few are in memory."""
    named: list[tuple[str, partial[Outcome]]] = []
    if args.cases != "own":
        if SHARED.exists():
            numbers = sorted(p.name for p in SHARED.iterdir() if p.name != "truth")
            named += [(f"shared-{n} shared", partial(_run_shared, n)) for n in numbers]
        else:
            print(f"no shared cases: {SHARED} is not there", file=sys.stderr)
    if args.cases != "shared":
        named += [(f"{p.name} {p.group}", partial(_run_own, p)) for p in plan(args.seed)]
    jobs = [job for name, job in named if args.select in name]
    if args.limit and args.limit < len(jobs):
        jobs = [jobs[k * len(jobs) // args.limit] for k in range(args.limit)]
    return jobs


def _run_own(case_plan) -> Outcome:
    return run_case(case_plan.make())


def _run_shared(number: str) -> Outcome:
    return run_case(next(case for case in shared_cases() if case.name == f"shared-{number}"))


def _run(jobs: Sequence[partial[Outcome]], workers: int) -> Iterator[Outcome]:
    """Yield outcomes as they arrive, from `workers` processes, or from this one when that is 1."""
    if workers == 1:
        yield from (job() for job in jobs)
        return
    with ProcessPoolExecutor(workers) as pool:
        for future in as_completed([pool.submit(job) for job in jobs]):
            yield future.result()


def _line(outcome: Outcome, number: int, total: int) -> str:
    """Return one case in one line: truth or faults, named causes, their sizes, gain, time."""
    sizes = ", ".join(f"{f.parameter} {f.value:.4g} of {f.truth:.4g}" for f in outcome.found if f.main)
    said = " + ".join(outcome.named) or outcome.verdict
    mark = "ok   " if outcome.right else "rival" if outcome.right_or_rival else "WRONG"
    text = f"[{number:3d}/{total}] {mark} {outcome.name:<46} {said}"
    text += f" ({sizes})" if sizes else ""
    text += f" gain {outcome.gain:.3f}/{outcome.gain_fresh:.3f}" if outcome.named else ""
    text += f" residual {outcome.times_noise:.2f} x noise, {outcome.seconds:.1f} s"
    text += f" faults: {', '.join(outcome.faults_found)}" if outcome.faults_found else ""
    return text + (f"\n{outcome.error}" if outcome.error else "")


def _write(args: argparse.Namespace, outcomes: Sequence[Outcome]) -> None:
    """Write the outcomes so far to a new file first, so that a stopped run leaves whole files."""
    entries = [{**asdict(o), "right": o.right, "right_or_rival": o.right_or_rival} for o in outcomes]
    summary = [asdict(m) for m in measures(outcomes)]
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        aside = args.json.with_name(args.json.name + ".part")
        aside.write_text(json.dumps({"measures": summary, "cases": entries}, indent=1))
        aside.replace(args.json)
