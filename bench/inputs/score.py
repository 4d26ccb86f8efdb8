"""Bad and unusual inputs, as a bench or a recorder may make them, through the command line, with ceilings.

matrix: every rig, verb and subset of channels, pairwise rates, lengths, commands, clocks and dead sensors.
mutations: damaged files of every format that is read. The promise: a result, or status 2 and one line.
"""

import math
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

from bench.inputs import formats, matrix
from bench.inputs.outcome import FAULTS, REFUSED, RESULT, Outcome, Work, serve, warm
from bench.results import Row, append_line, read_lines

PARTS = ("matrix", "mutations")


def main(
    *, quick: bool = False, part: Annotated[tuple[str, ...], PARTS] = PARTS, jobs: int = 2, seed: int = 1,
    count: int = 6000, samples: float = math.inf, only: tuple[str, ...] = (), log: Path | None = None,
    keep: Path | None = None, verbose: bool = False,
) -> Generator[Row | str, None, int]:  # fmt: skip
    """Play the requested parts and print the table; status 1 when a promise was broken.

    quick: a small part of each
    jobs: children at a time
    seed: of design and mutations
    count: of mutated files
    samples: leave out bags with more samples in a channel
    only: lines that hold all of these
    log: JSON lines, every case with its outcome; the cases of it that kept the promise are not run again
    keep: a folder for mutated files that broke a promise
    verbose: print each failure in full
    """
    warm()
    broken = 0
    done = {line.pop("case"): Outcome(**line) for line in (read_lines(log) if log else ())}
    kept = {name: outcome for name, outcome in done.items() if not outcome.is_fault}
    for title, works in _parts(quick, part, seed, 300 if quick else count, samples, keep):
        chosen = [(name, work) for name, work in works if all(text in name for text in only)]
        outcomes = [(name, kept[name]) for name, _ in chosen if name in kept]
        left, began = [work for name, work in chosen if name not in kept], time.monotonic()
        with tempfile.TemporaryDirectory(prefix="rsea-inputs-", ignore_cleanup_errors=True) as folder:
            for name, outcome in serve(left, Path(folder), jobs):
                outcomes.append((name, outcome))
                if log:
                    append_line(log, {"case": name, **vars(outcome)})
                if sys.stderr.isatty():
                    print(f"\r{title}: {len(outcomes)}\033[K", end="\r", file=sys.stderr)
        if outcomes:
            took = time.monotonic() - began
            yield f"\n{title}: {len(outcomes)}, those of {len(left)} works in {took:.0f} s"
            broken += yield from table(outcomes, verbose)
    return int(broken > 0)


def _parts(
    quick: bool, parts: Sequence[str], seed: int, count: int, samples: float, keep: Path | None
) -> Iterator[tuple[str, Iterable[tuple[str, Work]]]]:
    if "matrix" in parts:
        others = sorted(matrix.other_cases(seed, quick), key=matrix.expense)
        yield "rigs and numbers", matrix.works(others, matrix.play_other)
        cases, said = matrix.bag_cases(seed, quick)
        cases = sorted((c for c in cases if matrix.samples(c) <= samples), key=matrix.expense)
        yield f"bags ({said})", matrix.works(cases, matrix.play_bag)
    if "mutations" in parts:
        yield "mutated files", formats.batches(seed, count, keep)


def table(
    outcomes: Sequence[tuple[str, Outcome]], verbose: bool
) -> Generator[Row | str, None, int]:
    """Yield how many there are of each kind by verb or format, then each broken promise once with a case."""
    kinds: Counter[tuple[str, str]] = Counter()
    for name, outcome in outcomes:
        verb = re.search(r"verb=(\w+)", name)
        kinds[verb[1] if verb else name.split()[0], outcome.kind] += 1
    kinds += Counter(("all", outcome.kind) for _, outcome in outcomes)
    shown = [k for k in (RESULT, REFUSED, *FAULTS) if kinds["all", k]]
    for what in dict.fromkeys(what for what, _ in kinds):
        yield Row(what, "", {k: str(kinds[what, k]) for k in shown})
    slowest = max(outcomes, key=lambda item: item[1].seconds)
    largest = max(outcomes, key=lambda item: item[1].megabytes)
    yield f"  longest {slowest[1].seconds:.1f} s of processor: {slowest[0]}"
    yield f"  largest {largest[1].megabytes:.0f} MB: {largest[0]}"
    broken = [(name, outcome) for name, outcome in outcomes if outcome.is_fault]
    for (kind, where), count in Counter((o.kind, o.where) for _, o in broken).most_common():
        name, example = next((n, o) for n, o in broken if (o.kind, o.where) == (kind, where))
        yield f"  {count:4d} × {kind}: {where}\n         {name}"
        if verbose:
            yield "         " + example.detail.replace("\n", "\n         ")
    return len(broken)
