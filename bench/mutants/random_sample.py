"""A random sample of faults over every module of rsea_ros, each against the tests that import its module.

Called by `python -m bench mutants --random N --seed S`. The tests that are nearest come first: those that
import the module itself, then the steps of test/golden that call it. A fault that none of them notices
counts as unnoticed.
"""

from __future__ import annotations

import cProfile
import os
import random
import re
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import TextIO

from bench.mutants.imports import PACKAGES, ROOT, imported, reachable
from bench.mutants.operators import Mutant, mutants_of
from bench.mutants.run import SURVIVED, BenchError, outcomes

WAIT = re.compile(r"^(nodes/|hardware/test_(faults|lost|port|netft|line)|watch/|cli/test_(demo|run_launch))")
"""Tests that wait for nodes and wires: too slow, and not made for a fork."""
DIRECT, FAR = 8, 2
"""Files of tests that are played: those that import the module, those that reach it."""
LIMIT = 240.0
"""s of CPU for a fault."""
GOLDEN = "golden/test_golden.py"


def play(count: int, seed: int) -> int:
    """Play a sample and print each survivor, the kinds that survive and the share that was noticed."""
    chosen, steps = _sample(count, seed), _steps()
    seen: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    for target, mutants in sorted(chosen.items()):
        told: dict[Mutant, str] = {}
        try:
            tests = (*tests_of(target), *steps.get(target, (GOLDEN,)))
            outcomes(target, tests, mutants, lambda m, o, _, told=told: told.update({m: o}), LIMIT)
        except BenchError as error:
            print(error, flush=True)
            seen["not played"] += len(mutants)
            continue
        for mutant, outcome in told.items():
            seen[outcome] += 1
            if outcome == SURVIVED:
                kinds[target.split("/")[0]] += 1
                print(f"  {target}.py:{mutant.line} {mutant.where}: {mutant.text}", flush=True)
    played = sum(seen.values()) - seen["not played"]
    share = 1.0 - seen[SURVIVED] / max(1, played)
    print(f"survivors by folder: {dict(kinds.most_common())}")
    print(f"{played} of {count} faults played, {seen[SURVIVED]} unnoticed: {100.0 * share:.1f} % noticed")
    return 0 if share >= 0.85 else 1


def _sample(count: int, seed: int) -> dict[str, list[Mutant]]:
    """Return random faults by module, each fault of the package as likely as any other."""
    every = [
        (str(path.relative_to(ROOT / "rsea_ros").with_suffix("")), mutant)
        for path in sorted((ROOT / "rsea_ros").rglob("*.py"))
        if path.name not in ("__init__.py", "__main__.py")
        for mutant in mutants_of(path.read_text(encoding="utf-8"))
    ]
    chosen: dict[str, list[Mutant]] = defaultdict(list)
    for target, mutant in random.Random(seed).sample(every, count):
        chosen[target].append(mutant)
    return chosen


def tests_of(target: str) -> tuple[str, ...]:
    """Return the files of tests that import a module, the nearest first, below test/."""
    name = f"rsea_ros.{target.replace('/', '.')}"
    direct, far = [], []
    for file in sorted((ROOT / "test").rglob("test_*.py")):
        where = str(file.relative_to(ROOT / "test"))
        if WAIT.match(where):
            continue
        names = {n for n in imported(file) if n.split(".")[0] in PACKAGES}
        if name in names:
            direct.append(where)
        elif any(name in reachable(n) for n in names):
            far.append(where)
    stem, folder = Path(target).name, str(Path(target).parent)

    def distance(where: str) -> tuple[bool, bool, int]:
        lines = len((ROOT / "test" / where).read_text(encoding="utf-8"))
        return stem not in where, not where.startswith(folder), lines

    near = sorted(direct, key=distance)[:DIRECT] + sorted(far, key=distance)[:FAR]
    return tuple(where for where in near if where != GOLDEN)


def _steps() -> dict[str, list[str]]:
    """Return the steps of test/golden that call a module, the shortest first, by module; played in a fork."""
    inlet, outlet = os.pipe()
    if os.fork() == 0:
        with os.fdopen(outlet, "w") as lines:
            _watch_steps(lines)
        os._exit(0)
    os.close(outlet)
    with os.fdopen(inlet) as lines:
        told = [line.split() for line in lines]
    os.wait()
    found: dict[str, list[str]] = defaultdict(list)
    for _, step, target in sorted((float(seconds), step, target) for seconds, step, target in told):
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
        for step in (*VERBS, *SCRIPTS):
            profile = cProfile.Profile(builtins=False)
            begun = time.process_time()
            profile.runcall(desk.play, step)
            seconds = time.process_time() - begun
            codes = (entry.code for entry in profile.getstats())
            called = {code.co_filename for code in codes if not isinstance(code, str)}
            for file in called:
                if file.startswith(package):
                    print(seconds, step, file.removeprefix(package).removesuffix(".py"), file=lines)
