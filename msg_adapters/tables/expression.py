"""Expressions of columns: `0.12 * i_q - 0.4 * sign(omega)`, `derivative(phi)`, `column("tau [Nm]") * gain`.

The syntax tree is held against a list (numbers, names, + - * / **, and calls of the functions below), and
what is on the list is computed node by node. So attributes, subscripts, texts, comprehensions, lambdas and
imports are never evaluated, numbers are doubles, and an expression takes at most SIZE passes over samples.
Its values are real and finite, or holes of its columns, or it is refused (decision 0130).
"""

import ast
import difflib
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rsea_ros.documents.wording import brief, quote
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import running_integral

LONGEST, SIZE = 1000, 200
"""Characters, and parts of the syntax tree."""
COLUMN = "column"
"""`column("…")`: a column whose name is no plain word."""
_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip
_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, *_OPERATORS)

PLAIN: Mapping[str, tuple[Callable[..., Any], int, str]] = {
    "abs": (np.abs, 1, "absolute value"),
    "sqrt": (np.sqrt, 1, "square root"),
    "sin": (np.sin, 1, "sine of rad"),
    "cos": (np.cos, 1, "cosine of rad"),
    "tan": (np.tan, 1, "tangent of rad"),
    "atan2": (np.arctan2, 2, "angle of (y, x), rad"),
    "exp": (np.exp, 1, "exponential"),
    "log": (np.log, 1, "natural logarithm"),
    "sign": (np.sign, 1, "-1, 0 or 1"),
    "minimum": (np.minimum, 2, "the smaller of two, sample by sample"),
    "maximum": (np.maximum, 2, "the larger of two, sample by sample"),
    "clip": (np.clip, 3, "x within (x, low, high)"),
    "unwrap": (np.unwrap, 1, "angle in rad without jumps of 2 pi"),
    "mean": (np.nanmean, 1, "mean over the record"),
    "first": (lambda x: x[0] if np.ndim(x) else x, 1, "first sample"),
    "int8": (lambda x: _wrapped(x, 8), 1, "signed 8 bit number that was read as unsigned: 255 is -1"),
    "int16": (lambda x: _wrapped(x, 16), 1, "signed 16 bit number that was read as unsigned: 65535 is -1"),
    "int32": (lambda x: _wrapped(x, 32), 1, "signed 32 bit number that was read as unsigned"),
    "uint8": (lambda x: np.mod(x, 2**8), 1, "unsigned 8 bit number: -1 is 255"),
    "uint16": (lambda x: np.mod(x, 2**16), 1, "unsigned 16 bit number: -1 is 65535"),
    "uint32": (lambda x: np.mod(x, 2**32), 1, "unsigned 32 bit number"),
    "sign_magnitude": (
        lambda x, y: np.where(np.mod(x, 2.0 ** (y + 1)) < 2.0**y, 1.0, -1.0) * np.mod(x, 2.0**y),
        2,
        "number whose bit y, from 0, is its sign: (1030, 10) is -6",
    ),
}
"""By name: function, how many arguments, meaning."""
TIMED: Mapping[str, tuple[Callable[[Any, FloatArray], Any], int, str]] = {
    "derivative": (lambda x, t: np.gradient(x, t), 1, "rate of change, 1/s, central differences"),
    "integral": (running_integral, 1, "integral over time since the first sample, trapezoids"),
}
FUNCTIONS = {**PLAIN, **TIMED}
DECODING = frozenset(name for name in PLAIN if "int" in name) | {"sign_magnitude", "unwrap"}
"""What makes numbers of raw codes."""


@dataclass(frozen=True)
class Expression:
    """text: as the map has it. columns: that it names, each once."""

    text: str
    columns: tuple[str, ...]

    @property
    def decodes(self) -> bool:
        """Whether it makes numbers of raw codes."""
        nodes = ast.walk(ast.parse(self.text.strip(), mode="eval"))
        return any(isinstance(node, ast.Name) and node.id in DECODING for node in nodes)

    def values(self, columns: Mapping[str, FloatArray], t: FloatArray) -> FloatArray:
        """Return its value at every sample. columns: by name, shape (n,). t: stamps, s, shape (n,).

        Raises ValueError for an expression that cannot be computed.
        """
        named = {name: np.asarray(columns[name], np.float64) for name in self.columns}
        with np.errstate(all="ignore"):
            try:
                result = _value(ast.parse(self.text.strip(), mode="eval").body, named, t)
                values: FloatArray = np.broadcast_to(result, t.shape).copy()
            except (ValueError, IndexError) as error:  # of a function: too few samples, say
                reason = brief(" ".join(str(error).split()))
                raise ValueError(f"{quote(self.text)} cannot be computed: {reason}") from None
        if (wrong := np.isinf(values)).any():
            at = int(np.argmax(wrong))
            raise ValueError(
                f"{quote(self.text)} is {values[at]} at sample {at + 1}, expected a finite number"
            )
        return values


def parse(text: str) -> Expression:
    """Return a checked expression. Raises ValueError naming the part that it may not have."""
    if len(text) > LONGEST:
        raise ValueError(f"has {len(text)} characters, expected at most {LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"is {quote(text)}, expected columns, numbers, + - * / ** and functions") from None
    nodes = list(ast.walk(tree))
    if len(nodes) > SIZE:
        raise ValueError(f"has {len(nodes)} parts, expected at most {SIZE}")
    functions = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    quoted = {id(text): text.value for text in map(_column_name, nodes) if text is not None}
    for node in nodes:
        _check(node, text, is_quoted=id(node) in quoted)
    plain = [n.id for n in nodes if isinstance(n, ast.Name) and id(n) not in functions]
    for name in plain:
        if name in FUNCTIONS or name == COLUMN:
            raise ValueError(f"has the function {name} without values, expected column({name!r}) or a call")
    columns = (*plain, *map(str, quoted.values()))
    if not columns:
        raise ValueError(f"is {quote(text)}, which names no column, expected one or more")
    return Expression(text, tuple(dict.fromkeys(columns)))


def _column_name(node: ast.AST) -> ast.Constant | None:
    """Return the text of a node that is `column("…")`, else None."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == COLUMN):
        return None
    text = node.args[0] if len(node.args) == 1 and not node.keywords else None
    return text if isinstance(text, ast.Constant) and isinstance(text.value, str) else None


def _check(node: ast.AST, text: str, *, is_quoted: bool) -> None:
    if isinstance(node, ast.operator | ast.unaryop) and type(node) not in _OPERATORS:
        raise ValueError(f"has {type(node).__name__}, expected + - * / **")
    if not isinstance(node, _NODES):
        part = brief(ast.get_source_segment(text.strip(), node) or text)
        raise ValueError(f"has {part!r}, expected columns, numbers, + - * / ** and functions")
    if isinstance(node, ast.Call) and _column_name(node) is None:
        name = node.func.id if isinstance(node.func, ast.Name) else "a call of a result"
        if name not in FUNCTIONS:
            near = difflib.get_close_matches(name, FUNCTIONS, n=1)
            hint = f", did you mean {near[0]}?" if near else ""
            raise ValueError(f"calls {brief(name)}, expected {COLUMN}, {', '.join(FUNCTIONS)}{hint}")
        given, count = len(node.args) + len(node.keywords), FUNCTIONS[name][1]
        if given != count or node.keywords:
            raise ValueError(f"calls {name} with {given} values, expected {count}")
    if isinstance(node, ast.Constant) and not is_quoted:
        value = node.value
        if not isinstance(value, (int, float)) or isinstance(value, bool) or not abs(value) < 1e300:
            raise ValueError(f"has {quote(value)}, expected a plain number")


def _value(node: ast.AST, columns: Mapping[str, FloatArray], t: FloatArray) -> Any:
    """Return what a node of a checked tree is: a double, or one a sample; NaN where a column has a hole.

    Raises ValueError where it is no real number.
    """
    if isinstance(node, ast.Constant):
        return np.float64(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return columns[node.id]
    if isinstance(node, ast.BinOp):
        pair = _value(node.left, columns, t), _value(node.right, columns, t)
        return _real(_OPERATORS[type(node.op)](*pair), pair)
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, columns, t))
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    if (text := _column_name(node)) is not None:
        return columns[str(text.value)]
    arguments = [_value(one, columns, t) for one in node.args]
    if node.func.id in PLAIN:
        result = PLAIN[node.func.id][0](*arguments)
        return result if node.func.id == "unwrap" else _real(result, arguments)
    return TIMED[node.func.id][0](np.broadcast_to(arguments[0], t.shape), t)


def _real(result: Any, arguments: Sequence[Any]) -> Any:
    """Return a result. Raises ValueError where it is NaN and its arguments are not."""
    made = np.isnan(result)
    for one in arguments:
        made = made & ~np.isnan(one)
    if np.any(made):
        raise ValueError(f"no real number at sample {int(np.argmax(made)) + 1}")
    return result


def _wrapped(x: Any, bits: int) -> Any:
    return np.mod(np.asarray(x) + 2.0 ** (bits - 1), 2.0**bits) - 2.0 ** (bits - 1)
