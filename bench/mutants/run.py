"""Runs the tests of a module once for each of its mutants, each in a fork of a process that is warm.

Two forks: one for each module has imported all that the tests need and that does not import the module; from
it one for each mutant, in which the module is imported with its fault and the tests are collected and run.
"""

from __future__ import annotations

import ast
import gc
import importlib.machinery
import importlib.util
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from bench.mutants.imports import ROOT, warm
from bench.mutants.operators import Mutant, mutate
from rsea_ros.compiler import SHARED

KILLED, SURVIVED, TIMEOUT = "killed", "survived", "timeout"
MEMORY = 8 * 2**30
"""Bytes that a mutant may take."""
CHILD = """
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
"""Python runs it first in every process that the tests start."""


class BenchError(Exception):
    """The tests do not pass without a fault, or do not run."""


def outcomes(
    target: str,
    tests: Sequence[Sequence[str]],
    mutants: Sequence[Mutant],
    tell: Callable[[Mutant, str, float], None],
    limit: float | None = None,
) -> None:
    """Run the tests of a module for each mutant; tell outcome and seconds of each.

    tests: groups of them, played one after the other up to the first that notices the mutant; the outcome
    names its number where there are several. limit: s of CPU for a mutant, where the tests are known to pass;
    by default they are played without a fault first. Raises BenchError where they fail without one.
    """
    inlet, outlet = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(inlet)
        _serve(target, tests, mutants, outlet, limit)
    os.close(outlet)
    with os.fdopen(inlet) as lines:
        for line in lines:
            place, outcome, seconds = line.split()
            if place == "baseline":
                if outcome != SURVIVED:
                    os.waitpid(pid, 0)
                    words = " ".join(f"test/{test}" for group in tests for test in group)
                    raise BenchError(
                        f"{target}: its tests do not pass without a fault ({outcome}), expected that of"
                        f" ./rsea test {words} -n 0"
                    )
                continue
            tell(mutants[int(place)], outcome, float(seconds))
    if os.waitpid(pid, 0)[1] != 0:
        raise BenchError(f"{target}: the process that runs its mutants has died")


def _serve(
    target: str, tests: Sequence[Sequence[str]], mutants: Sequence[Mutant], outlet: int, limit: float | None
) -> None:
    """Run all mutants of a module, write a line for each, and end this process."""
    status = 1
    try:
        name, path = f"rsea_ros.{target.replace('/', '.')}", ROOT / "rsea_ros" / f"{target}.py"
        groups = [[ROOT / "test" / test for test in group] for group in tests]
        warm(name, [file for group in groups for file in group if file.exists()])
        gc.freeze()
        source = path.read_text()
        outcome, cpu, wall = SURVIVED, (limit or 0.0) / 3.0, limit or 0.0
        if limit is None:
            every = [file for group in groups for file in group]
            outcome, cpu, wall = _fork(lambda: _play(name, path, ast.parse(source), every), 600.0, 600.0)
        os.write(outlet, f"baseline {outcome} {cpu}\n".encode())
        for k, mutant in enumerate(mutants if outcome == SURVIVED else ()):
            tree, took = mutate(source, mutant), 0.0
            for number, group in enumerate(groups):
                outcome, _, seconds = _fork(
                    lambda tree=tree, group=group: _play(name, path, tree, group),
                    3.0 * cpu + 3.0, 5.0 * wall + 15.0,
                )  # fmt: skip
                took += seconds
                if outcome != SURVIVED:
                    outcome += f"-by-{number}" * (len(groups) > 1)
                    break
            os.write(outlet, f"{k} {outcome} {took:.2f}\n".encode())
        status = 0
    finally:
        os._exit(status)


def _fork(work: Callable[[], int], cpu: float, wall: float) -> tuple[str, float, float]:
    """Run some work in a fork; return its outcome, the s of CPU and of the clock that it took."""
    begun = time.monotonic()
    pid = os.fork()
    if pid == 0:
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 2))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, wall)
            os._exit(work())
        finally:
            os._exit(1)
    _, status, usage = os.wait4(pid, 0)
    if os.WIFSIGNALED(status):
        late = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL)
        outcome = TIMEOUT if late else KILLED
    else:
        outcome = SURVIVED if os.WEXITSTATUS(status) == 0 else KILLED
    return outcome, usage.ru_utime + usage.ru_stime, time.monotonic() - begun


def _play(name: str, path: Path, tree: ast.Module, files: Sequence[Path]) -> int:
    """Import a module from a syntax tree, here and in children; return pytest's status on some files."""
    import numba
    import pytest

    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    sys.meta_path.insert(0, _Finder(name, path, tree))
    os.chdir(ROOT)
    without = ("cacheprovider", "unraisableexception", "threadexception")  # the last two collect garbage
    flags = [flag for name in without for flag in ("-p", f"no:{name}")]
    flags += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # of plugins that are imported already
    with tempfile.TemporaryDirectory() as folder:
        child = CHILD.format(source=ast.unparse(tree), name=name, path=str(path))
        Path(folder, "sitecustomize.py").write_text(child)
        _start_all_with(folder)
        if any(fnmatch(str(path.relative_to(ROOT / "rsea_ros")), pattern) for pattern in SHARED):
            numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = folder  # compiled into other files
        return int(pytest.main(["-x", "-q", *flags, *map(str, files)]))


def _start_all_with(folder: str) -> None:
    """Let every process that is started look into a folder first of all."""
    begin: Any = subprocess.Popen.__init__

    def init(self: Any, *args: Any, env: Any = None, **options: Any) -> None:
        env = dict(os.environ if env is None else env)
        env["PYTHONPATH"] = os.pathsep.join(filter(None, [folder, env.get("PYTHONPATH")]))
        begin(self, *args, env=env, **options)

    subprocess.Popen.__init__ = init  # type: ignore[method-assign]


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a module from a syntax tree in place of its file."""

    def __init__(self, name: str, path: Path, tree: ast.Module) -> None:
        super().__init__(name, str(path))
        self._tree = tree

    def get_code(self, fullname: str) -> object:
        return compile(self._tree, self.path, "exec")


class _Finder:
    """Finds one module, for which a syntax tree is given."""

    def __init__(self, name: str, path: Path, tree: ast.Module) -> None:
        self._name, self._path, self._tree = name, path, tree

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> object:
        if fullname != self._name:
            return None
        loader = _Loader(fullname, self._path, self._tree)
        return importlib.util.spec_from_file_location(fullname, self._path, loader=loader)
