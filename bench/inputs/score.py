"""Bad and unusual inputs, as a bench or a recorder may make them, through the command line, with ceilings.

    python -m bench inputs                    all parts, a table
    python -m bench inputs --quick            a few minutes of them
    python -m bench inputs --part matrix --only "verb=diagnose"
    python -m bench inputs --part matrix --log matrix.jsonl --resume matrix.jsonl    go on after a break

matrix: every rig, verb and subset of channels, pairwise rates, lengths, commands, clocks and dead sensors.
mutations: damaged files of every format that is read. The promise: a result, or status 2 and one line.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import rsea_ros  # noqa: F401  first of all: it keeps numpy from starting threads of its own
from bench import parser_of

# isort: split
from bench.inputs import matrix, mutations
from bench.inputs.outcome import FAULTS, REFUSED, RESULT, Outcome
from bench.inputs.server import Work, serve, warm

PARTS = ("matrix", "mutations")


def main(argv: Sequence[str]) -> int:
    """Play the requested parts and print the table; status 1 when a promise was broken."""
    args = _arguments(argv)
    folder = Path(tempfile.mkdtemp(prefix="rsea-inputs-"))
    warm()
    broken = 0
    try:
        if "matrix" in args.part:
            others = sorted(matrix.other_cases(args.seed, args.quick), key=matrix.expense)
            broken += play("rigs and numbers", matrix.works(others, matrix.play_other, "r"), args, folder, "")
            cases, said = matrix.bag_cases(args.seed, args.quick)
            cases = sorted((c for c in cases if matrix.samples(c) <= args.samples), key=matrix.expense)
            broken += play("bags", matrix.works(cases, matrix.play_bag, "b"), args, folder, said)
        if "mutations" in args.part:
            count = 300 if args.quick else args.count
            broken += damage(args, count, folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return 1 if broken else 0


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--quick", action="store_true", help="a small part of each")
    parser.add_argument("--part", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--jobs", type=int, default=2, help="children at a time (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of design and mutations (default %(default)s)")
    parser.add_argument("--count", type=int, default=6000, help="of mutated files (default %(default)s)")
    parser.add_argument(
        "--samples", type=float, default=1e9, metavar="N", help="bags of up to N samples a channel"
    )
    parser.add_argument("--only", nargs="+", default=[], metavar="TEXT", help="lines that hold all of these")
    parser.add_argument("--log", type=Path, help="JSON lines: every case with its outcome")
    parser.add_argument(
        "--resume", type=Path, metavar="LOG", help="skip the cases of this log that kept the promise"
    )
    parser.add_argument("--keep", type=Path, metavar="DIR", help="copy mutated files that broke a promise")
    parser.add_argument("--verbose", action="store_true", help="print each failure in full")
    return parser.parse_args(argv)


def play(title: str, work: Iterable[Work], args: argparse.Namespace, folder: Path, said: str) -> int:
    """Play the cases of a part, print its table, and return how many broke the promise."""
    chosen = [w for w in work if all(text in w[0] for text in args.only)]
    if not chosen:
        return 0
    inside = folder / title.replace(" ", "_")
    inside.mkdir()
    kept = kept_promises(args.resume)
    outcomes = [(name, kept[_case(name)]) for name, _ in chosen if _case(name) in kept]
    began, before = time.monotonic(), len(outcomes)
    for name, outcome in serve((w for w in chosen if _case(w[0]) not in kept), inside, args.jobs):
        outcomes.append((name, outcome))
        _log(args.log, outcomes[-1:])
        if sys.stderr.isatty():
            print(f"\r{title}: {len(outcomes)} of {len(chosen)}", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    earlier = f" and {before} from {args.resume}" if before else ""
    took = f"{len(outcomes) - before} in {time.monotonic() - began:.0f} s{earlier}"
    print(f"\n{title}: {took}" + (f" ({said})" if said else ""))
    return table(outcomes, args.verbose)


def damage(args: argparse.Namespace, count: int, folder: Path) -> int:
    """Read mutated files, print each format and the table; return how many broke the promise."""
    began, outcomes = time.monotonic(), []
    for name, outcome in mutations.run(args.seed, count, folder, args.jobs, args.only):
        outcomes.append((name, outcome))
        _log(args.log, outcomes[-1:])
        if args.keep is not None and outcome.is_fault:
            _keep(args.keep, name)
    if not outcomes:
        return 0
    print(f"\nmutated files: {len(outcomes)} in {time.monotonic() - began:.0f} s")
    kinds = Counter((name.split()[0], outcome.kind) for name, outcome in outcomes)
    for form in dict.fromkeys(form for form, _ in kinds):
        total = sum(n for (f, _), n in kinds.items() if f == form)
        faults = sum(n for (f, kind), n in kinds.items() if f == form and kind in FAULTS)
        print(
            f"  {form:<12} {total:6d} files, {kinds[form, REFUSED]:6d} refused, {faults:4d} broken promises"
        )
    return table(outcomes, args.verbose)


def _keep(folder: Path, name: str) -> None:
    """Copy the file that broke a promise."""
    source = Path(name.partition("(")[2].rstrip(")"))
    folder.mkdir(parents=True, exist_ok=True)
    if source.exists():
        shutil.copy(source, folder / "-".join(name.split()[:3]))


def _log(path: Path | None, outcomes: list[tuple[str, Outcome]]) -> None:
    if path is not None:
        with path.open("a", encoding="utf-8") as file:
            for name, outcome in outcomes:
                file.write(json.dumps({"case": name, **vars(outcome)}) + "\n")


def kept_promises(log: Path | None) -> dict[str, Outcome]:
    """Return the cases of a log whose last outcome kept the promise; a line that broke off is left out."""
    last: dict[str, Outcome] = {}
    for line in log.read_text(encoding="utf-8").splitlines() if log is not None and log.exists() else ():
        with suppress(ValueError):
            read = json.loads(line)
            name = read.pop("case")
            last[_case(name)] = Outcome(**read)
    return {case: outcome for case, outcome in last.items() if not outcome.is_fault}


def _case(name: str) -> str:
    """Return a case without its number, because new rigs and effects change that."""
    return name.partition(" ")[2]


def table(outcomes: list[tuple[str, Outcome]], verbose: bool) -> int:
    """Print how many there are of each kind, then each broken promise once, with a case that shows it."""
    kinds = Counter(outcome.kind for _, outcome in outcomes)
    for kind in (RESULT, REFUSED, *FAULTS):
        print(f"  {kind:<12} {kinds[kind]:6d}")
    slowest = max(outcomes, key=lambda item: item[1].seconds)
    largest = max(outcomes, key=lambda item: item[1].megabytes)
    print(f"  longest {slowest[1].seconds:.1f} s of processor: {slowest[0]}")
    print(f"  largest {largest[1].megabytes:.0f} MB: {largest[0]}")
    broken = [(name, outcome) for name, outcome in outcomes if outcome.is_fault]
    places = Counter((outcome.kind, outcome.where) for _, outcome in broken)
    for (kind, where), count in places.most_common():
        name, example = next((n, o) for n, o in broken if (o.kind, o.where) == (kind, where))
        print(f"  {count:4d} × {kind}: {where}\n         {name}")
        if verbose:
            print("         " + example.detail.replace("\n", "\n         "))
    return len(broken)
