"""Who imports whom, read from the syntax tree of every module."""

import ast
import gc
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOPS = ("rsea_ros", "msg_adapters", "rsea_extras")
EXPANDED = ("rsea_ros", "rsea_ros.extension")
"""Packages whose names are modules, or have one each."""
MODULES = sorted(path for top in TOPS for path in (ROOT / top).rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    """Return the syntax tree of a module, read once, without the garbage collector looking through all."""
    gc.disable()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    gc.freeze()
    gc.enable()
    return tree


@cache
def nodes(tree: ast.Module) -> list[ast.AST]:
    """Return all nodes of a tree: to walk through the modules takes as long as to parse them."""
    return list(ast.walk(tree))


def found_in_modules(offences: Callable[[Path, ast.Module], Iterable[object]]) -> list[str]:
    """Return the offences of all modules, each with the path of its module."""
    found = ((path, each) for path in MODULES for each in offences(path, tree_of(path)))
    return [f"{path.relative_to(ROOT)}: {each}" for path, each in found]


def name_of(path: Path) -> str:
    """Return the dotted name of a module's file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path, source: str | ast.Module) -> Iterator[tuple[str, int]]:
    """Yield every module that a source imports, at any depth, by its absolute name, with its line."""
    for node in nodes(ast.parse(source) if isinstance(source, str) else source):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = absolute(path, node)
            names = [f"{module}.{alias.name}" for alias in node.names] if module in EXPANDED else [module]
            yield from ((name, node.lineno) for name in names)


def absolute(path: Path, node: ast.ImportFrom) -> str:
    """Return the absolute name of the module of a `from … import`."""
    if not node.level:
        return str(node.module)
    ancestors = path.relative_to(ROOT).parent.parts
    kept = ancestors[: len(ancestors) - node.level + 1]
    return ".".join([*kept, node.module] if node.module else kept)
