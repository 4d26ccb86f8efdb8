"""Runs tests against one mutant of a module, in a process in which the module is imported with its fault.

The other processes that the tests start import it so too.
"""

import ast
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from shutil import copytree, ignore_patterns

from bench import ROOT
from bench.mutants.operators import Mutant, mutate
from rsea_ros.compiler import SHARED, cache_folder

MEMORY = 8 * 2**30
"""Bytes that a mutant may take."""
FIRST = """
import os
import subprocess

begin = subprocess.Popen.__init__

def init(self, *args, env=None, **options):
    env = dict(os.environ if env is None else env)
    env["PYTHONPATH"] = os.pathsep.join(filter(None, [{folder!r}, env.get("PYTHONPATH")]))
    begin(self, *args, env=env, **options)

subprocess.Popen.__init__ = init
"""
"""As sitecustomize.py of a folder Python runs it first in every process, also where a test states its own
environment."""
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
"""After it: the module is made of a text."""


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
