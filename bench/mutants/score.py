"""Mutation run: a random sample of small faults in rsea_ros, each against the tests that call its function.

It stops after some minutes, and the same command goes on: outcomes are kept in out/mutants-*.jsonl, which you
delete after a change. Prints each fault that nobody notices, and a table by folder; status 1 where under 85 %
are noticed.

Tests that wait for nodes and wires come last. A fault is noticed by them where they pass without it.
"""

import time
from collections.abc import Generator, Mapping
from random import Random

from bench import ROOT
from bench.mutants.calls import calls, is_called, seconds_of, tests_of
from bench.mutants.operators import Mutant, mutants_of
from bench.mutants.run import is_noticed
from bench.results import Row, append_line, read_lines

NOTICED = "noticed"
LEAST = 0.85
"""Share of the faults that tests must notice."""


def main(
    *, random: int = 60, seed: int = 0, in_: str = "", minutes: float = 8.0, list_: bool = False
) -> Generator[Row | str, None, int]:
    """Play a sample, or go on with it.

    random: so many faults
    seed: of the sample
    in_: of a module or folder only
    minutes: begin no fault after that
    list_: print the faults and play none
    """
    chosen = _sample(random, seed, in_)
    if list_:
        yield from (f"{target}.py:{_text(mutant)}" for target, mutant in chosen)
        return 0
    log = ROOT / "out" / f"mutants-{in_.replace('/', '-') or 'all'}-{random}-{seed}.jsonl"
    told = {(line["target"], line["fault"]): line["outcome"] for line in read_lines(log)}
    calls()
    begun = time.monotonic()
    for target, mutant in chosen:
        fault = _text(mutant)
        if (target, fault) not in told and time.monotonic() - begun < 60.0 * minutes:
            told[target, fault] = noticed = _outcome(target, mutant)
            append_line(log, {"target": target, "fault": fault, "outcome": noticed})
            yield f"{target}.py:{fault}: {noticed}"
    return (yield from _shown(told, len(chosen) - len(told), seed))


def _text(m: Mutant) -> str:
    return f"{m.line} {m.where}: {m.text} ({m.place}, {m.choice})"


def _shown(told: Mapping[tuple[str, str], str], left: int, seed: int) -> Generator[Row | str, None, int]:
    yield from (f"  {target}.py:{fault}: {seen}" for (target, fault), seen in told.items() if seen != NOTICED)
    whole = f"all, seed {seed}"
    for folder in (*sorted({target.split("/")[0] for target, _ in told}), whole):
        these = [o for (t, _), o in told.items() if folder in (t.split("/")[0], whole)]
        seen = these.count(NOTICED)
        share = f"{100.0 * seen / max(1, len(these)):.1f}"
        yield Row(folder, "", {"faults": str(len(these)), "noticed": str(seen), "%": share})
    if left:
        yield f"{left} faults are left: the same command goes on"
    return int(seen < LEAST * len(these))


def _outcome(target: str, mutant: Mutant) -> str:
    """Play a fault against its tests, those that wait last, and only where the others don't notice it."""
    for tests, is_sure in zip(tests_of(target, mutant.where), (True, False), strict=True):
        if tests and is_noticed(target, tests, mutant, seconds_of(tests), is_sure):
            return NOTICED
    return "survived" if is_called(target, mutant.where) else "survived, called by no test"


def _sample(count: int, seed: int, place: str) -> list[tuple[str, Mutant]]:
    """Return random faults with their modules, of a place each as likely as any other; all where fewer."""
    start = ROOT / "rsea_ros" / place
    every = [
        (str(path.relative_to(ROOT / "rsea_ros").with_suffix("")), mutant)
        for path in sorted((ROOT / "rsea_ros").rglob("*.py"))
        if path.name not in ("__init__.py", "__main__.py") and f"{path}/".startswith(str(start))
        for mutant in mutants_of(path.read_text(encoding="utf-8"))
    ]
    return Random(seed).sample(every, min(count, len(every)))
