"""What may be imported before a module is mutated: all that its tests need and that does not import it."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from bench import ROOT

PACKAGES = ("rsea_ros", "msg_adapters", "bench")


def warm(target: str, tests: Iterable[Path]) -> None:
    """Import the package and what some tests import, as far as it does not import the target.

    Raises RuntimeError where the target is imported all the same: its faults would never be played.
    """
    files = (ROOT / "rsea_ros").rglob("[!_]*.py")
    names = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files}
    names = names.union(*map(imported, tests))
    beside = {path.stem for path in (ROOT / "test").rglob("*.py")}
    for name in sorted(names | set().union(*map(reachable, names))):
        if name.split(".")[0] not in beside and target not in {name, *reachable(name)}:
            try:
                import_module(name)
            except ImportError:  # of another system
                continue
    if target in sys.modules:
        raise RuntimeError(f"{target} is imported before it has a fault, expected after")


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
