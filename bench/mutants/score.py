"""Mutation run: a random sample of small faults in rsea_ros, each against the tests that are near its module.

It stops after some minutes, and the same command goes on: outcomes are kept in out/mutants-*.jsonl, which you
delete after a change. Prints each fault that nobody notices, and a table by folder; status 1 where under 85 %
are noticed.

First come the tests that import the module or reach it, the nearest first, and the steps of test/golden that
call it; then, for folders that have such, what starts nodes and wires. A fault that none of them notices is
unnoticed, also where the latter fail without one.
"""

from __future__ import annotations

import cProfile
import json
import os
import re
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Generator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from random import Random
from typing import TextIO

from bench import ROOT
from bench.mutants.operators import Mutant, mutants_of
from bench.mutants.run import PACKAGES, SURVIVED, BenchError, imported, outcome, reachable
from bench.results import Row, append_line, read_lines

LEAST = 0.85
"""Share of the faults that tests must notice."""
WAIT = re.compile(r"^(nodes/|hardware/test_(faults|lost|port|netft|line)|watch/|cli/test_(demo|run_launch))")
"""Tests that wait for nodes and wires."""
WIRED = ("nodes", "hardware", "hardware/netft", "hardware/peer", "hardware/dynamixel", "watch", "cli")
"""Folders whose faults they are played for."""
DIRECT, FAR, WIRES = 8, 2, 3
"""Files of tests that are played, of those that import the module, reach it, and wait."""
LIMIT = 240.0
"""s of CPU for a fault."""
GOLDEN = "golden/test_golden.py"


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
    steps, begun = _steps(), time.monotonic()
    for target, mutant in chosen:
        fault = _text(mutant)
        if (target, fault) not in told and time.monotonic() - begun < 60.0 * minutes:
            told[target, fault] = noticed = _outcome(target, mutant, steps.get(target, ()))
            append_line(log, {"target": target, "fault": fault, "outcome": noticed})
            yield f"{target}.py:{fault}: {noticed}"
    return (yield from _shown(told, len(chosen) - len(told), seed))


def _text(m: Mutant) -> str:
    return f"{m.line} {m.where}: {m.text} ({m.place}, {m.choice})"


def _shown(told: Mapping[tuple[str, str], str], left: int, seed: int) -> Generator[Row | str, None, int]:
    yield from (f"  {target}.py:{fault}" for (target, fault), seen in told.items() if seen == SURVIVED)
    whole = f"all, seed {seed}"
    for folder in (*sorted({target.split("/")[0] for target, _ in told}), whole):
        these = [o for (t, _), o in told.items() if folder in (t.split("/")[0], whole)]
        seen = len(these) - these.count(SURVIVED)
        share = f"{100.0 * seen / max(1, len(these)):.1f}"
        yield Row(folder, "", {"faults": str(len(these)), "noticed": str(seen), "%": share})
    if left:
        yield f"{left} faults are left: the same command goes on"
    return int(seen < LEAST * len(these))


def _outcome(target: str, mutant: Mutant, steps: Sequence[str]) -> str:
    """Play a fault against its tests, one after the other, up to the first that notices it."""
    near, wires = tests_of(target)
    for tests, limit in (((*near, *steps), LIMIT), (wires, None)):
        try:
            if tests and outcome(target, tests, mutant, limit) != SURVIVED:
                return "noticed"
        except BenchError as error:
            print(error, file=sys.stderr, flush=True)
    return SURVIVED


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


def tests_of(target: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return files of tests that notice a module below test/, the nearest first; those that wait apart.

    Effects are loaded by their names: nothing imports them, and all tests of effects play them.
    """
    name = f"rsea_ros.{target.replace('/', '.')}"
    stem, folder = Path(target).name, str(Path(target).parent)
    nodes = [p.stem for p in (ROOT / "rsea_ros" / "nodes").glob("[!_]*.py")]
    started = [n for n in nodes if name in {f"rsea_ros.nodes.{n}", *reachable(f"rsea_ros.nodes.{n}")}]
    direct, far, wires = [], [], []
    for file in sorted((ROOT / "test").rglob("test_*.py")):
        where, text = str(file.relative_to(ROOT / "test")), file.read_text(encoding="utf-8")
        names = {n for n in imported(file) if n.split(".")[0] in PACKAGES}
        close = (stem.strip("_") not in where, not where.startswith(folder), name not in names, len(text))
        if WAIT.match(where):
            starts = folder == "nodes" and any(f'start("{n}"' in text for n in started)
            if starts or (folder in WIRED and (name in names or close[:2] == (False, False))):
                wires.append((close, where))
        elif where == GOLDEN:
            continue
        elif name in names:
            direct.append((close, where))
        elif any(name in reachable(n) for n in names) or (folder == "effects" and where.startswith(folder)):
            far.append((close, where))
    near = (*sorted(direct)[:DIRECT], *sorted(far)[: FAR if direct else DIRECT])
    return tuple(where for _, where in near), tuple(where for _, where in sorted(wires)[:WIRES])


def _steps() -> dict[str, list[str]]:
    """Return the steps of test/golden that call a module, the shortest first, by module.

    They are played once in a fork, and kept in out/ until the steps change.
    """
    kept = ROOT / "out" / "golden-calls.json"
    script = (ROOT / "test" / "golden" / "steps.py").read_text(encoding="utf-8")
    known = json.loads(kept.read_text()) if kept.exists() else {}
    if known.get("script") != script:
        with tempfile.TemporaryFile("w+") as lines:
            if os.fork() == 0:
                _watch_steps(lines)
                os._exit(0)
            os.wait()
            lines.seek(0)
            known = {"script": script, "calls": [line.split() for line in lines]}
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(json.dumps(known))
    found: dict[str, list[str]] = defaultdict(list)
    for _, step, target in sorted((float(seconds), step, target) for seconds, step, target in known["calls"]):
        found[target].append(f"{GOLDEN}::test_it_says_what_it_said[{step}]")
    return found


def _watch_steps(lines: TextIO) -> None:
    """Play every step, and write seconds, step and module for each module that it calls."""
    sys.path += [str(ROOT), str(ROOT / "test" / "golden"), str(ROOT / "test" / "trends")]
    from steps import SCRIPTS, VERBS
    from test_golden import Desk

    package = str(ROOT / "rsea_ros") + os.sep
    os.environ["COLUMNS"] = "100"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        desk = Desk(Path(folder))
        for step in chain(VERBS, SCRIPTS):
            profile = cProfile.Profile(builtins=False)
            begun = time.process_time()
            profile.runcall(desk.play, step)
            seconds = time.process_time() - begun
            codes = (entry.code for entry in profile.getstats())
            called = {code.co_filename for code in codes if not isinstance(code, str)}
            for file in called:
                if file.startswith(package):
                    print(seconds, step, file.removeprefix(package).removesuffix(".py"), file=lines)
    lines.flush()
