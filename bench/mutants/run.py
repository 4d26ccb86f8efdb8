"""Runs tests against one mutant of a module, in a process in which the module is imported with its fault.

The other processes that the tests start import it so too.
"""

from __future__ import annotations

import ast
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from shutil import copytree, ignore_patterns

from bench import ROOT
from bench.mutants.operators import Mutant, mutate
from rsea_ros.compiler import SHARED, cache_folder

PACKAGES = ("rsea_ros", "msg_adapters", "bench")
KILLED, SURVIVED = "killed", "survived"
MEMORY = 8 * 2**30
"""Bytes that a mutant may take."""
CUSTOM = """
import os
import subprocess
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
begin = subprocess.Popen.__init__

def init(self, *args, env=None, **options):
    env = dict(os.environ if env is None else env)
    env["PYTHONPATH"] = os.pathsep.join(filter(None, [{folder!r}, env.get("PYTHONPATH")]))
    begin(self, *args, env=env, **options)

subprocess.Popen.__init__ = init
"""
"""Python runs it first in every process: the module is made of a text, also where a test states its own
environment."""


class BenchError(Exception):
    """The tests do not pass without a fault, or do not run."""


def outcome(target: str, tests: Sequence[str], mutant: Mutant, limit: float | None = None) -> str:
    """Return whether tests, one after the other, notice a mutant.

    limit: s of CPU, where the tests are known to pass; by default they are played without the fault first.
    Raises BenchError where they fail without it.
    """
    source = (ROOT / "rsea_ros" / f"{target}.py").read_text()
    cpu, wall = limit or 0.0, 5.0 * (limit or 0.0)
    if limit is None:
        passed, took, longest = _played(target, tests, ast.parse(source), 600.0, 600.0)
        if passed != SURVIVED:
            words = " ".join(f"test/{test}" for test in tests)
            raise BenchError(
                f"{target}: its tests do not pass without a fault, expected that of ./rsea test {words} -n 0"
            )
        cpu, wall = 3.0 * took + 3.0, 5.0 * longest + 15.0
    return _played(target, tests, mutate(source, mutant), cpu, wall)[0]


def _played(
    target: str, tests: Sequence[str], tree: ast.Module, cpu: float, wall: float
) -> tuple[str, float, float]:
    """Play tests with a module made of a syntax tree; return the outcome, s of CPU and of the clock."""
    name, path = f"rsea_ros.{target.replace('/', '.')}", ROOT / "rsea_ros" / f"{target}.py"
    without = ("cacheprovider", "unraisableexception", "threadexception")  # the last two collect garbage
    flags = [flag for plugin in without for flag in ("-p", f"no:{plugin}")]
    words = [sys.executable, "-m", "pytest", "-x", "-q", *flags, *(str(ROOT / "test" / t) for t in tests)]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 2))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    with tempfile.TemporaryDirectory() as folder:
        text = CUSTOM.format(source=ast.unparse(tree), name=name, path=str(path), folder=folder)
        Path(folder, "sitecustomize.py").write_text(text)
        environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": f"{folder}:{ROOT}"}
        environment["NUMBA_CACHE_DIR"] = folder
        if not any(fnmatch(f"{target}.py", pattern) for pattern in SHARED):  # those are compiled into others
            copytree(cache_folder(), folder, copy_function=os.link, dirs_exist_ok=True,
                     ignore=ignore_patterns(f"{path.stem}.*", "tmp*"))  # fmt: skip
        begun, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
        quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        try:
            done = subprocess.run(
                words, cwd=ROOT, env=environment, timeout=wall, preexec_fn=limit, check=False, **quiet
            )
            status = done.returncode
        except subprocess.TimeoutExpired:
            status = 1
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    return SURVIVED if status == 0 else KILLED, spent, time.monotonic() - begun


@cache
def reachable(name: str) -> frozenset[str]:
    """Return the modules of this repository that a module imports, directly or not, with their packages."""
    reached: set[str] = set()
    waiting = [name]
    while waiting:
        of = waiting.pop()
        path, package = _path(of), of.rpartition(".")[0]
        fresh = {package, *(imported(path) if path else ())} - {"", *reached}
        reached |= fresh
        waiting += fresh
    return frozenset(reached)


@cache
def imported(path: Path) -> frozenset[str]:
    return frozenset(_names(ast.parse(path.read_text())))


def _names(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=aliases):
                yield from (a.name for a in aliases)
            case ast.ImportFrom(module=str(module), names=aliases, level=0):
                yield module
                yield from (n for a in aliases if _path(n := f"{module}.{a.name}"))


def _path(name: str) -> Path | None:
    if name.split(".")[0] not in PACKAGES:
        return None
    stem = ROOT.joinpath(*name.split("."))
    return next((p for p in (stem.with_suffix(".py"), stem / "__init__.py") if p.is_file()), None)
