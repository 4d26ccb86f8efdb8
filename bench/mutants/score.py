"""Mutation run: small faults are put into decision functions, and their tests must notice.

    python -m bench mutants                                  every module of targets.py
    python -m bench mutants hardware/limits --list           its mutants
    python -m bench mutants --sample 60 --seed 1             so many of each module
    python -m bench mutants --random 200 --seed 4            of all modules of rsea_ros, as they come
    python -m bench mutants --log run.jsonl --resume run.jsonl    go on after a break

Prints killed, survived and timed-out mutants of each module, and every survivor with the reason why it is no
fault, from mutants/explained.yaml. Status 1 where under 85 % of a module's mutants are noticed, a survivor
has no reason, or a reason stands for a mutant that is noticed or is no more. docs/testing.md says more.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TextIO

import rsea_ros.cli  # noqa: F401  first of all: it keeps numpy from starting threads of its own

# isort: split
import hypothesis  # noqa: F401  what every test needs, once
import numpy  # noqa: F401
import pytest  # noqa: F401
import scipy  # noqa: F401
import xdist.scheduler  # noqa: F401
import yaml

from bench import ROOT, parser_of
from bench.mutants import random_sample
from bench.mutants.operators import Mutant, mutants_of
from bench.mutants.run import SURVIVED, BenchError, outcomes
from bench.mutants.targets import TARGETS
from bench.results import read_lines

LEAST = 0.85
"""Share of the mutants that tests must notice."""
FEWEST = 60
"""Mutants of a module in a sample, at least; all where it has fewer."""
EXPLAINED = Path(__file__).with_name("explained.yaml")

Reasons = Mapping[tuple[str, str], str]


@dataclass(frozen=True)
class Played:
    """The mutants of a module that were played, with the outcome of each, and how many it has."""

    target: str
    outcomes: dict[Mutant, str]
    total: int

    @property
    def survivors(self) -> list[Mutant]:
        return [m for m, outcome in self.outcomes.items() if outcome == SURVIVED]

    @property
    def noticed(self) -> float:
        return 1.0 - len(self.survivors) / max(1, len(self.outcomes))


def main(argv: Sequence[str]) -> int:
    """Run the mutants and print the table; status 1 where one got through without a reason."""
    args = _arguments(argv)
    if args.random:
        return random_sample.play(args.random, args.seed, args.minutes)
    known = _resume(args.resume)
    log = args.log.open("a") if args.log else None
    explained = yaml.safe_load(EXPLAINED.read_text()) or {}
    failures, begun = 0, time.monotonic()
    for target in args.modules or TARGETS:
        mutants = mutants_of((ROOT / "rsea_ros" / f"{target}.py").read_text())
        if args.list:
            print(*(f"{target}.py:{m.line} {m.where}: {m.text}" for m in mutants), sep="\n")
            continue
        chosen = _sample(mutants, args.sample, args.seed)
        try:
            played = Played(target, _outcomes(target, chosen, known, log), len(mutants))
        except BenchError as error:
            print(error, flush=True)
            failures += 1
            continue
        failures += show(played, _reasons(explained.get(target, {})))
    if not args.list:
        print(f"{time.monotonic() - begun:.0f} s")
    return 1 if failures else 0


def show(played: Played, reasons: Reasons) -> int:
    """Print the outcomes of a module; return the number of broken promises."""
    counts = Counter(played.outcomes.values())
    sample = f" (sample of {played.total})" if len(played.outcomes) < played.total else ""
    print(
        f"{played.target}: {len(played.outcomes)} mutants{sample}, {counts['killed']} killed,"
        f" {counts['survived']} survived, {counts['timeout']} timed out: {100 * played.noticed:.1f} % noticed"
    )
    broken = played.noticed < LEAST
    for m in played.survivors:
        reason = reasons.get((m.where, m.text))
        broken += reason is None
        print(f"  {played.target}.py:{m.line} {m.where}: {m.text}\n      {reason or 'NOT EXPLAINED'}")
    alive = {(m.where, m.text) for m in played.survivors}
    gone = [] if sample else [key for key in reasons if key not in alive]
    for where, text in gone:
        print(f"  {where}: {text}\n      explained, but noticed or no more: delete the reason")
    sys.stdout.flush()
    return broken + len(gone)


def _outcomes(
    target: str, mutants: Sequence[Mutant], known: Mapping[tuple[str, ...], str], log: TextIO | None
) -> dict[Mutant, str]:
    """Return the outcome of each mutant, those of a run before included."""
    key = partial(_key, target)
    result = {m: known[key(m)] for m in mutants if key(m) in known}

    def tell(mutant: Mutant, outcome: str, seconds: float) -> None:
        result[mutant] = outcome
        if log is not None:
            log.write(json.dumps({"key": key(mutant), "outcome": outcome, "seconds": seconds}) + "\n")
            log.flush()

    left = [m for m in mutants if m not in result]
    if left:
        outcomes(target, [TARGETS[target]], left, tell)
    return dict(sorted(result.items(), key=lambda item: (item[0].line, item[0].place, item[0].choice)))


def _key(target: str, m: Mutant) -> tuple[str, ...]:
    """Return the key of a mutant in a log."""
    return target, str(m.line), m.where, m.text, str(m.place), str(m.choice)


def _sample(mutants: list[Mutant], count: int | None, seed: int) -> list[Mutant]:
    if count is None or count >= len(mutants):
        return mutants
    chosen = set(random.Random(seed).sample(range(len(mutants)), max(count, min(FEWEST, len(mutants)))))
    return [m for k, m in enumerate(mutants) if k in chosen]


def _reasons(places: Mapping[str, Mapping[str, str]]) -> Reasons:
    return {(where, text): reason for where, said in places.items() for text, reason in said.items()}


def _resume(path: Path | None) -> dict[tuple[str, ...], str]:
    entries = [] if path is None else read_lines(path)
    return {tuple(each["key"]): each["outcome"] for each in entries}


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=f"of {', '.join(TARGETS)}")
    parser.add_argument("--sample", type=int, metavar="N", help=f"so many of each module, {FEWEST} or more")
    parser.add_argument("--random", type=int, metavar="N", help="so many faults of all modules")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the sample")
    parser.add_argument("--minutes", type=float, default=8.0, metavar="M", help="of a random sample")
    parser.add_argument("--log", type=Path, metavar="F", help="append each outcome to a file")
    parser.add_argument("--resume", type=Path, metavar="F", help="take outcomes of a log of the same tree")
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    args = parser.parse_args(argv)
    unknown = [m for m in args.modules if m not in TARGETS]
    if unknown:
        parser.error(f"{', '.join(unknown)}: expected one of {', '.join(TARGETS)}")
    return args
