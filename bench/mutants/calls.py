"""Which tests call a function: from one run of the suite in which every process notes what it calls.

The notes are kept in out/mutant-calls.txt, which you delete after a change of the tests. A new function is
noted by nobody: its module's and its importers' tests play it.
"""

import ast
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from bench import ROOT

NOTES = ROOT / "out" / "mutant-calls.txt"
RECORDER = Path(__file__).with_name("recorder.py")
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
LOADING = """
import sys
from importlib.util import module_from_spec, spec_from_file_location

spec = spec_from_file_location("recorder", {recorder!r})
sys.modules["recorder"] = module_from_spec(spec)
spec.loader.exec_module(sys.modules["recorder"])
"""
WAIT = (
    "test/nodes/", "test/extras/watch/", "test/extras/nodes/", "test/cli/test_demo",
    "test/cli/test_run_launch",
    *(f"test/hardware/test_{name}" for name in ("faults", "lost", "frames", "netft", "line")),
)  # fmt: skip
"""Tests that wait for nodes and wires."""
LONGEST = 1500.0
"""s for one run of the suite under the recorder."""
LIMIT = 90.0
"""s of CPU of the tests that are played for a fault; the nearest file in any case."""
WIRES = 6
"""Files that wait, of those."""


class Calls(NamedTuple):
    """tests: files of tests by module and function, a step of test/golden for itself. seconds: of CPU.
    width: functions that a file calls."""

    tests: dict[tuple[str, str], set[str]]
    seconds: dict[str, float]
    width: dict[str, int]


@cache
def calls() -> Calls:
    """Read the notes, which a run of the suite makes first where there are none."""
    if not NOTES.exists():
        _note()
    tests: dict[tuple[str, str], set[str]] = defaultdict(set)
    seconds, seen = defaultdict(float), defaultdict(set)
    for line in NOTES.read_text(encoding="utf-8").splitlines():
        match line.split("\t"):
            case [unit, target, name]:
                tests[target, name].add(unit)
                seen[unit].add((target, name))
            case [unit, spent]:
                seconds[unit] += float(spent)
    return Calls(dict(tests), dict(seconds), {unit: len(names) for unit, names in seen.items()})


def _note() -> None:
    """Play the suite with the recorder in every process. A test that fails under it has noted its calls."""
    print("first the suite is played once, to see which tests call what: 8 minutes", flush=True)
    NOTES.parent.mkdir(exist_ok=True)
    making = NOTES.with_suffix(".new")
    making.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        text = FIRST.format(folder=folder) + LOADING.format(recorder=str(RECORDER))
        Path(folder, "sitecustomize.py").write_text(text)
        environment = os.environ | {
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "RECORD": str(making),
            "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}",
        }  # fmt: skip
        words = [sys.executable, "-m", "pytest", "-q", "-p", "recorder", "-n", "2", "--dist", "loadfile"]
        # ends threads by exceptions: never, beside the recorder
        words.append("--ignore=test/extras/fleet/test_time_limit.py")
        try:
            subprocess.run(
                words, cwd=ROOT, env=environment, check=False, stdout=subprocess.DEVNULL, timeout=LONGEST
            )
        except subprocess.TimeoutExpired:
            sys.exit(f"the suite was not through after {LONGEST:g} s, expected a quieter machine")
    making.rename(NOTES)


def tests_of(target: str, where: str) -> tuple[list[str], list[str]]:
    """Return the tests that may notice a fault in a function, the nearest first; those that wait apart.

    Those that call it; for what is outside a function, compiled, or called by none, all that import its
    module, call anything of it or stand in its folder, then those that call anything of its importers; at
    last test/golden, which says what every verb and table says.
    """
    known = calls()
    name = where.rpartition(".")[2]
    found = known.tests.get((target, name), set())
    beside = [u for u in known.seconds if _imports(u, target) or u.startswith(f"test/{Path(target).parent}/")]
    groups: list[Iterable[str]] = (
        [found] if found else [{*_of_modules([target]), *beside}, _of_modules(_importers(target))]
    )
    ordered: list[str] = []
    for group in groups:
        ordered += sorted(set(group) - set(ordered), key=lambda u: _distance(target, u))
    waiting = [u for u in ordered if u.startswith(WAIT)][:WIRES]
    near = _within_limit([u for u in ordered if not u.startswith(WAIT)])
    said = () if found else (u for u in known.seconds if u.startswith("test/golden/"))
    return list(dict.fromkeys([*near, *said])), waiting


def seconds_of(tests: Iterable[str]) -> float:
    """Return the s of CPU that tests take."""
    return sum(calls().seconds.get(unit, 1.0) for unit in tests)


def is_called(target: str, where: str) -> bool:
    """Return whether any test calls a function, as far as could be noted."""
    return (target, where.rpartition(".")[2]) in calls().tests


def _of_modules(targets: Iterable[str]) -> set[str]:
    wanted = set(targets)
    return {u for (target, _), units in calls().tests.items() if target in wanted for u in units}


def _distance(target: str, unit: str) -> tuple[bool, bool, bool, float]:
    """By its name, by what it imports, by its folder, and a test of little before one of much."""
    stem, folder = Path(target).name.strip("_"), str(Path(target).parent)
    known = calls()
    far = known.width.get(unit, 0) * (1.0 + known.seconds.get(unit, 0.0))
    beside = unit.startswith(f"test/{folder}/")
    return stem not in Path(unit).name, not _imports(unit, target), not beside, far


def _within_limit(units: Sequence[str]) -> list[str]:
    chosen, spent = [], 0.0
    for unit in units:
        needs = calls().seconds.get(unit, 1.0)
        if not chosen or spent + needs < LIMIT:
            chosen.append(unit)
            spent += needs
    return chosen


def _imports(unit: str, target: str) -> bool:
    return f"rsea_ros.{target.replace('/', '.')}" in _imported(ROOT / unit.partition("::")[0])


def _importers(target: str) -> list[str]:
    """Return the modules of rsea_ros that import a module by its name."""
    name = f"rsea_ros.{target.replace('/', '.')}"
    package = ROOT / "rsea_ros"
    return [
        str(path.relative_to(package).with_suffix(""))
        for path in package.rglob("*.py")
        if name in _imported(path)
    ]


@cache
def _imported(path: Path) -> frozenset[str]:
    return frozenset(_names(ast.parse(path.read_text(encoding="utf-8"))))


def _names(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=aliases):
                yield from (a.name for a in aliases)
            case ast.ImportFrom(module=str(module), names=aliases, level=0):
                yield from (module, *(f"{module}.{a.name}" for a in aliases))
