"""What may be imported before a module is mutated: all that its tests need and that does not import it."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from bench import ROOT

PACKAGES = ("rsea_ros", "msg_adapters")


def warm(target: str, tests: Iterable[Path]) -> None:
    """Import the package and what some tests import, as far as it does not import the target."""
    files = (ROOT / "rsea_ros").rglob("[!_]*.py")
    names = {".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files}
    for test in tests:
        names |= set(imported(test))
    for name in sorted(names | set().union(*(reachable(n) for n in names))):
        if target not in {name, *reachable(name)} and not name.startswith("test"):
            try:
                import_module(name)
            except ImportError:  # a helper beside the tests
                continue


@cache
def reachable(name: str) -> frozenset[str]:
    """Return the modules of this repository that a module imports, directly or not."""
    reached: set[str] = set()
    waiting = [name]
    while waiting:
        path = _path(waiting.pop())
        fresh = {n for n in imported(path) if n not in reached} if path else set()
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
