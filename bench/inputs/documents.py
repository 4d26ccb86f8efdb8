"""Damage to documents: YAML and JSON by their structure, tables by their cells, text by its characters."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import yaml

from bench.inputs.bytes_damage import damage_bytes

ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 10**30, 10**400, 0.0, -0.0, 1e308, -1e308, 5e-324, 1e-300, 1e30,
    float("nan"), float("inf"), -float("inf"), "", " ", "x", "nan", "1e5", "0x10", "1:30", "-", "null", "~",
    "a" * 100_000, "\u0000", "\x1b[2J", "ä", "\ud7ff", "2026-01-01", "[1]", "{", "*a", "&a", "!!python/none",
    "%",    [], {}, [None], [1, 2], [[]], {"a": 1}, {"": ""}, {1: 2}, [float("nan")], list(range(1000)),
)  # fmt: skip
ODD_LINES = (
    "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]", "? [a]\n: b", "<<: {a: 1}",
    "!!binary |\n  x",
    "!!python/object/apply:os.getcwd []", "--- {}\n---", "\t- x", "x: 2026-13-45", "x: 0o777", "x: .nan",
    "x: 1_000", "x: 190:20:30", "x: " + "[" * 2000, "{" * 500, "- " * 500, "%YAML 3.0", "\ufeffx: 1",
    "x: 'open",
)  # fmt: skip
ODD_CELLS = (
    "", " ", "nan", "inf", "-inf", "1e999", "1e308", "NA", "x", "1,5", "0x1F", "1 2", '"', '"1"', "\x00", "ä",
    "1e", "--1", "+1", "1_0", "٣", "9" * 400, "#1", "\ufeff1", "1;2", "1\t", "\r", "=1+1",
    "1" + " " * 10_000,
)  # fmt: skip


def damaged_yaml(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a YAML document changed in its structure, its text or its bytes."""
    return _damaged(rng, data, other, yaml.safe_load, partial(yaml.safe_dump, sort_keys=False))


def damaged_json(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a JSON document changed in its structure, its text or its bytes, or one nested deeply."""
    if rng.random() < 0.1:
        depth = rng.choice((10, 1000, 100_000))
        return b"[" * depth + b"]" * rng.choice((0, depth))
    return _damaged(rng, data, other, json.loads, json.dumps)


def _damaged(
    rng: random.Random, data: bytes, other: bytes, read: Callable[[str], Any], write: Callable[[Any], str]
) -> bytes:
    kind = rng.random()
    if kind < 0.6:
        with suppress(Exception):  # what was damaged before may be no document, or too deep to be written
            return write(change_nodes(rng, read(data.decode("utf-8")))).encode()
    return damaged_text(rng, data, other) if kind < 0.85 else damage_bytes(rng, data, other)


def change_nodes(rng: random.Random, document: Any) -> Any:
    """Return a document with some nodes replaced, removed, renamed, doubled or nested."""
    document = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 2, 4))):
        places = list(_places(document))
        if not places:
            return rng.choice(ODD_VALUES)
        parent, key = rng.choice(places)
        rng.choice(_NODE_KINDS)(rng, parent, key)
    return rng.choice(ODD_VALUES) if rng.random() < 0.02 else document


def _places(node: Any) -> Any:
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys:
        yield node, key
        yield from _places(node[key])


def _replace(rng: random.Random, parent: Any, key: Any) -> None:
    parent[key] = copy.deepcopy(rng.choice(ODD_VALUES))


def _remove(rng: random.Random, parent: Any, key: Any) -> None:
    del parent[key]


def _rename(rng: random.Random, parent: Any, key: Any) -> None:
    if isinstance(parent, dict):
        parent[rng.choice(("x", "", "value", 1, None, "name", str(key) + " "))] = parent.pop(key)


def _nest(rng: random.Random, parent: Any, key: Any) -> None:
    for _ in range(rng.choice((1, 3, 200))):
        parent[key] = [parent[key]] if rng.random() < 0.5 else {"value": parent[key]}


def _scale(rng: random.Random, parent: Any, key: Any) -> None:
    if isinstance(parent[key], (int, float)) and not isinstance(parent[key], bool):
        parent[key] = float(parent[key]) * rng.choice((-1.0, 0.0, 1e-300, 1e-12, 1e-3, 1e3, 1e12, 1e300))


def _double(rng: random.Random, parent: Any, key: Any) -> None:
    if isinstance(parent, list):
        parent.insert(key, copy.deepcopy(parent[key]))


_NODE_KINDS = (_replace, _replace, _remove, _rename, _nest, _scale, _scale, _scale, _double)


def damaged_text(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return text with lines moved, doubled, dropped or put in, other line ends, encodings and blanks."""
    lines = data.decode("utf-8", "replace").splitlines() or [""]
    for _ in range(rng.choice((1, 1, 2, 5))):
        rng.choice(_LINE_KINDS)(rng, lines)
    text = rng.choice(("\n", "\n", "\n", "\r\n", "\r", "\n\n")).join(lines)
    encoding = rng.choice(("utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1", "utf-32"))
    return text.encode(encoding, "replace")


def _line(
    change: Callable[[random.Random, list[str], int], None],
) -> Callable[[random.Random, list[str]], None]:
    return lambda rng, lines: change(rng, lines, rng.randrange(len(lines))) if lines else None


def _put(rng: random.Random, lines: list[str], at: int) -> None:
    lines.insert(at, rng.choice(ODD_LINES))


def _indent(rng: random.Random, lines: list[str], at: int) -> None:
    lines[at] = rng.choice((" ", "\t", "  ")) + lines[at]


def _token(rng: random.Random, lines: list[str], at: int) -> None:
    words = lines[at].split(" ")
    words[rng.randrange(len(words))] = str(rng.choice((*ODD_VALUES[:40], *ODD_CELLS)))
    lines[at] = " ".join(words)


_LINE_KINDS = tuple(map(_line, (
    _put, _indent, _token, _token,
    lambda rng, lines, at: lines.insert(at, lines[at]),
    lambda rng, lines, at: lines.pop(at) and None,
    lambda rng, lines, at: lines.append(lines.pop(at)),
    lambda rng, lines, at: lines.__setitem__(at, lines[at][: rng.randrange(len(lines[at]) + 1)]),
)))  # fmt: skip


def damaged_table(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a table of text with cells, rows, separators, quotes or bytes changed."""
    if rng.random() < 0.2:
        return damage_bytes(rng, data, other)
    if rng.random() < 0.15:
        return damaged_text(rng, data, other)
    rows = [line.split(",") for line in data.decode("utf-8", "replace").splitlines()] or [[""]]
    for _ in range(rng.choice((1, 1, 3))):
        row = rng.choice(rows) or [""]
        at = rng.randrange(len(row)) if row else 0
        kind = rng.randrange(6)
        if kind < 3 and row:
            row[at] = rng.choice(ODD_CELLS)
        elif kind == 3:
            row.insert(at, rng.choice(ODD_CELLS))
        elif kind == 4 and row:
            row.pop(at)
        else:
            rows.insert(rng.randrange(len(rows)), list(rng.choice(rows)))
    separator = rng.choice((",", ",", ",", ", ", ";", "\t", " ", "   ", " \t", "|", ",,", "\x00"))
    end = rng.choice(("", "", "", separator, "\t", " "))
    head = rng.choice(("", "", "", "\ufeff", "# a comment\n", "\n", "sep=;\n", '"'))
    return (head + rng.choice(("\n", "\n", "\r\n", "\r")).join(separator.join(r) + end for r in rows)).encode(
        rng.choice(("utf-8", "utf-8", "utf-8", "latin-1", "utf-16")), "replace"
    )
