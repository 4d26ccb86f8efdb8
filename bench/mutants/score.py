"""Mutation run: a random sample of small faults in rsea_ros, each against the tests that call its function.

It stops after some minutes, and the same command goes on: outcomes are kept in out/mutants-*.jsonl, which you
delete after a change. Prints each fault that nobody notices, and a table by folder; status 1 where under 85 %
are noticed.

Tests that wait for nodes and wires come last. A fault is noticed by them where they pass without it. A module
is imported with its fault, also by the other processes that the tests start.
"""

import ast
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from random import Random
from shutil import copytree, ignore_patterns

from bench import ROOT
from bench.mutants.calls import FIRST, calls, is_called, seconds_of, tests_of
from bench.mutants.operators import Mutant, mutants_of, mutate
from bench.results import Row, append_line, read_lines
from rsea_ros.compiler import SHARED, cache_folder

NOTICED = "noticed"
LEAST = 0.85
"""Share of the faults that tests must notice."""
MEMORY = 8 * 2**30
"""Bytes that a mutant may take."""
CUSTOM = """
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import spec_from_file_location

class Loader(SourceFileLoader):
    def get_code(self, name):
        return compile({source!r}, self.path, "exec")

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            return spec_from_file_location(name, {path!r}, loader=Loader(name, {path!r}))

sys.meta_path.insert(0, Finder())
"""
"""After it in sitecustomize.py: the module is made of a text."""


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


def is_noticed(target: str, tests: Sequence[str], mutant: Mutant, seconds: float, is_sure: bool) -> bool:
    """Return whether tests, one after the other, notice a mutant.

    seconds: of CPU that they take without it. is_sure: they pass without it; otherwise they are asked.
    """
    source = (ROOT / "rsea_ros" / f"{target}.py").read_text(encoding="utf-8")
    limit = 3.0 * seconds + 60.0
    return not _pass(target, tests, mutate(source, mutant), limit) and (
        is_sure or _pass(target, tests, ast.parse(source), limit)
    )


def _pass(target: str, tests: Sequence[str], tree: ast.Module, cpu: float) -> bool:
    """Play tests with a module made of a syntax tree, for so many s of CPU, 5 times as many by the clock."""
    name, path = f"rsea_ros.{target.replace('/', '.')}", ROOT / "rsea_ros" / f"{target}.py"
    without = ("cacheprovider", "unraisableexception", "threadexception")  # the last two collect garbage
    flags = [flag for plugin in without for flag in ("-p", f"no:{plugin}")]
    words = [sys.executable, "-m", "pytest", "-x", "-q", *flags, *tests]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 2))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    with tempfile.TemporaryDirectory() as folder:
        text = FIRST.format(folder=folder) + CUSTOM.format(
            source=ast.unparse(tree), name=name, path=str(path)
        )
        Path(folder, "sitecustomize.py").write_text(text)
        environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": f"{folder}:{ROOT}"}
        environment["NUMBA_CACHE_DIR"] = folder
        if not any(fnmatch(f"{target}.py", pattern) for pattern in SHARED):  # those are compiled into others
            copytree(cache_folder(), folder, copy_function=os.link, dirs_exist_ok=True,
                     ignore=ignore_patterns(f"{path.stem}.*", "tmp*"))  # fmt: skip
        quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        try:
            done = subprocess.run(
                words, cwd=ROOT, env=environment, timeout=5.0 * cpu, preexec_fn=limit, check=False, **quiet
            )
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0
