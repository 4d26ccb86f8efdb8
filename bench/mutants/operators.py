"""Mutants of a module: copies of its syntax tree with one small fault each.

A fault replaces one node: a comparison, `and` or `or`, an operator, a number, a text, a truth value, a
condition by its opposite, min by max, a returned value by None, a statement by nothing. Left alone are
annotations, decorators, docstrings, the words of exceptions and f-strings, and what changes nothing that
anybody could notice: `strict=` of zip, which only asserts; None for False, which mypy sees; numbers below
1e-9, which are room for rounding; how long one waits for what comes anyway; seeds of random numbers.
"""

import ast
import copy
import re
from collections.abc import Iterator
from dataclasses import dataclass

COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
CALLS = {
    "min": "max", "any": "all", "floor": "ceil", "minimum": "maximum", "argmin": "argmax",
}  # fmt: skip
CALLS |= {after: before for before, after in CALLS.items()}
TINY = 1e-9
WAITS = re.compile(r"timeout|wait|join|sleep|acquire|spin\w*|default_rng|Random")
"""Calls and keywords whose numbers are waiting times, s, or seeds."""
QUIET_CALLS = {"TypeVar", "NewType", "Literal", "cast"}
"""Calls and subscripts whose texts are names and types."""


@dataclass(frozen=True)
class Mutant:
    """A fault. line: of the source. where: function or class, dotted. text: `before -> after`.

    place: the node's number in the order of `ast.walk`. choice: which of the node's faults.
    """

    line: int
    where: str
    text: str
    place: int
    choice: int


def mutants_of(source: str) -> list[Mutant]:
    """Return every mutant of a module, in the order of its lines."""
    tree = ast.parse(source)
    parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    quiet = set(_quiet(tree))
    listed = [
        Mutant(node.lineno, _where(node, parents), _text(node, new, parents.get(node)), place, choice)
        for place, node in enumerate(ast.walk(tree))
        if isinstance(node, (ast.expr, ast.stmt)) and node not in quiet
        for choice, new in enumerate(replacements(node))
    ]
    return sorted(listed, key=lambda m: (m.line, m.place, m.choice))


def mutate(source: str, mutant: Mutant) -> ast.Module:
    """Return the syntax tree of a module with one fault in it."""
    tree = ast.parse(source)
    node = list(ast.walk(tree))[mutant.place]
    assert isinstance(node, (ast.expr, ast.stmt))
    new = ast.copy_location(list(replacements(node))[mutant.choice], node)
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is node:
                setattr(parent, name, new)
            elif isinstance(value, list):
                value[:] = [new if each is node else each for each in value]
    return ast.fix_missing_locations(tree)


def replacements(node: ast.expr | ast.stmt) -> Iterator[ast.expr | ast.stmt]:
    """Yield what a node becomes in each of its faults."""
    match node:
        case ast.Compare():
            for k, op in enumerate(node.ops):
                for other in COMPARISONS[type(op)]:
                    yield _change(node, ops=[*node.ops[:k], other(), *node.ops[k + 1 :]])
        case ast.BoolOp():
            yield _change(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
        case ast.BinOp() if type(node.op) in OPERATORS:
            yield _change(node, op=OPERATORS[type(node.op)]())
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node.operand
        case ast.Constant():
            yield from _constants(node.value)
        case ast.Call(func=ast.Name(id=name)) if name in CALLS:
            yield _change(node, func=_change(node.func, id=CALLS[name]))
        case ast.Call(func=ast.Attribute(attr=name)) if name in CALLS:
            yield _change(node, func=_change(node.func, attr=CALLS[name]))
        case ast.IfExp() | ast.If() | ast.While():
            yield _change(node, test=ast.UnaryOp(ast.Not(), node.test))
        case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
            yield from _filters(node)
        case _:
            yield from _statements(node)


def _statements(node: ast.expr | ast.stmt) -> Iterator[ast.stmt]:
    match node:
        case ast.Return(value=ast.Constant(value=None | False)):
            return
        case ast.Return(value=ast.expr()):
            yield ast.Return(ast.Constant(None))
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Raise() | ast.Delete():
            yield ast.Pass()
        case ast.Assign() if any(isinstance(t, (ast.Attribute, ast.Subscript)) for t in node.targets):
            yield ast.Pass()
        case ast.Continue():
            yield ast.Break()
        case ast.Break():
            yield ast.Continue()


def _constants(value: object) -> Iterator[ast.Constant]:
    if isinstance(value, bool):
        yield ast.Constant(not value)
    elif isinstance(value, int):
        yield ast.Constant(value + 1)
    elif isinstance(value, float):
        yield ast.Constant(1.5 * value if value else 1.0)
    elif isinstance(value, str):
        yield ast.Constant(f"XX{value}")


def _filters(node: ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp) -> Iterator[ast.expr]:
    """Yield the comprehension with the opposite of each of its conditions."""
    for k, loop in enumerate(node.generators):
        for i, test in enumerate(loop.ifs):
            ifs = [*loop.ifs[:i], ast.UnaryOp(ast.Not(), test), *loop.ifs[i + 1 :]]
            changed = _change(loop, ifs=ifs)
            yield _change(node, generators=[*node.generators[:k], changed, *node.generators[k + 1 :]])


def _quiet(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes that are left alone."""
    for node in ast.walk(tree):
        match node:
            case ast.Raise():
                yield from (n for n in ast.walk(node) if n is not node)
            case ast.JoinedStr():
                yield from (n for n in ast.walk(node) if isinstance(n, ast.Constant))
            case ast.Expr(value=ast.Constant()):
                yield node.value
            case ast.keyword(arg="strict"):
                yield node.value
            case ast.Constant(value=float(value)) if 0.0 < abs(value) < TINY:
                yield node
            case ast.keyword(arg=str(name)) if WAITS.fullmatch(name):
                yield node.value
            case ast.Call(func=ast.Attribute(attr=name)) if WAITS.fullmatch(name):
                yield from (a for a in node.args if isinstance(a, ast.Constant))
            case ast.Call(func=ast.Name(id=name)) | ast.Subscript(value=ast.Name(id=name)):
                if name in QUIET_CALLS:
                    yield from ast.walk(node)
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                yield from ast.walk(node)
        for name in ("annotation", "returns", "decorator_list"):
            value = getattr(node, name, None)
            for each in value if isinstance(value, list) else [value]:
                yield from ast.walk(each) if isinstance(each, ast.AST) else ()


def _where(node: ast.AST, parents: dict[ast.AST, ast.AST]) -> str:
    names = []
    while node in parents:
        node = parents[node]
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.append(node.name)
    return ".".join(reversed(names)) or "module"


def _text(node: ast.expr | ast.stmt, new: ast.expr | ast.stmt, parent: ast.AST | None) -> str:
    """Return the changed text; of a number or a text also the expression around it."""
    if isinstance(node, ast.Constant) and parent is not None and not isinstance(parent, ast.Module):
        around = copy.copy(parent)
        for name, value in ast.iter_fields(parent):
            if value is node:
                setattr(around, name, new)
            elif isinstance(value, list):
                setattr(around, name, [new if each is node else each for each in value])
        return f"{_line(parent)} -> {_line(around)}"
    return f"{_line(node)} -> {_line(new)}"


def _line(node: ast.AST) -> str:
    return ast.unparse(ast.fix_missing_locations(node)).split("\n", 1)[0]


def _change(node: ast.AST, **fields: object) -> ast.AST:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new
