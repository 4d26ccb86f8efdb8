"""No function takes ten arguments: values that belong together are one value."""

from __future__ import annotations

import ast
from pathlib import Path

from import_graph import found_in_modules

MOST = 9


def argument_counts(tree: ast.Module) -> dict[str, int]:
    """Return how many arguments each function of a module takes, self included."""
    functions = (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
    return {f.name: _count(f.args) for f in functions}


def _count(args: ast.arguments) -> int:
    return len([*args.posonlyargs, *args.args, *args.kwonlyargs, *filter(None, (args.vararg, args.kwarg))])


def offences(path: Path, tree: ast.Module) -> list[str]:
    """Return the functions of a module that take too many arguments."""
    return [f"{name} takes {count}" for name, count in argument_counts(tree).items() if count > MOST]


def test_no_function_takes_ten_arguments():
    assert found_in_modules(offences) == []


def test_every_kind_of_argument_counts():
    source = "class A:\n    def f(self, a, /, b, *c, d, **e): ...\nasync def g(): ..."
    assert argument_counts(ast.parse(source)) == {"f": 6, "g": 0}
