"""No function takes ten arguments: values that belong together are one value."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from import_graph import MODULES, ROOT

MOST = 9


def argument_counts(source: str) -> dict[str, int]:
    """Return how many arguments each function of a source takes, self included."""
    nodes = ast.walk(ast.parse(source))
    functions = (n for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
    return {f.name: _count(f.args) for f in functions}


def _count(args: ast.arguments) -> int:
    return len([*args.posonlyargs, *args.args, *args.kwonlyargs, *filter(None, (args.vararg, args.kwarg))])


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_function_takes_ten_arguments(path: Path):
    counts = argument_counts(path.read_text(encoding="utf-8"))
    assert {name: count for name, count in counts.items() if count > MOST} == {}


def test_every_kind_of_argument_counts():
    source = "class A:\n    def f(self, a, /, b, *c, d, **e): ...\nasync def g(): ..."
    assert argument_counts(source) == {"f": 6, "g": 0}
