"""Columns out of JSON: records, `[{"t": 0, "q": [1, 2]}, …]`, or columns, `{"t": [0, …], "q": [[1, 2], …]}`.

A column is named by its way, `log.motor.current`, through mappings and, once, through a list of records.
JSON lines (`.jsonl`, `.ndjson`) are a list of records.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.tables.child import finite_table
from msg_adapters.tables.column_table import Table, check_size, index_of
from msg_adapters.tables.elements import ElementAddress, place_of
from rsea_ros.documents.wording import brief, no_utf_8, quote
from rsea_ros.records.record import FloatArray

LARGEST_FILE = 200_000_000
"""Bytes: read as a whole, they take about eight times as much memory."""
LINES = (".jsonl", ".ndjson")
_DEEPEST = 4
"""Levels of names that a message lists."""


def read_json(path: Path, columns: Sequence[str]) -> Table:
    """Return the requested columns. Raises OSError and ValueError with column, sample and expectation."""
    if path.stat().st_size > LARGEST_FILE:
        raise ValueError(f"{path.stat().st_size} bytes of JSON, expected fewer than {LARGEST_FILE}")
    document = _document(path)
    vectors = {column: _vector(column, document) for column in columns}
    check_size(len(next(iter(vectors.values()))), len(columns))
    return finite_table(vectors)


def _document(path: Path) -> Any:
    try:
        text = path.read_text(encoding="utf-8-sig")
        if path.suffix not in LINES:
            return _parse(text)
        lines = ((number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip())
        return [_parse(line, number) for number, line in lines]
    except UnicodeDecodeError as error:
        raise ValueError(f"{no_utf_8(error)}, expected JSON in UTF-8") from None
    except RecursionError:
        raise ValueError("JSON of too many levels, expected records or columns of numbers") from None


def _parse(text: str, line: int | None = None) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        where = f"line {line or error.lineno}, column {error.colno}"
        raise ValueError(f"{where}: {error.msg[0].lower()}{error.msg[1:]}, expected JSON") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a mapping. Raises ValueError for a key that stands twice."""
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"key {quote(twice)} stands twice in a mapping, expected once")
    return mapping


def _vector(column: str, document: Any) -> FloatArray:
    place = place_of(column)
    try:
        cells = _cells(document, place.base)
    except KeyError:
        index_of(column, list(dict.fromkeys(_names(document))))
        raise ValueError(f"column {column!r} is not a list of numbers, expected one") from None
    if place.is_row:
        cells = _element(cells, place, column, 0)
    if not isinstance(cells, list) or len(cells) < 2:
        raise ValueError(f"column {column!r} is {quote(cells)}, expected a list of numbers")
    return np.array([_number(cell, place, column, at) for at, cell in enumerate(cells)], np.float64)


def _cells(value: Any, way: str) -> Any:
    """Return the values at the end of a path. Raises KeyError where it leads nowhere."""
    if not way:
        return value
    if isinstance(value, dict):
        if way in value:
            return value[way]
        for at, letter in enumerate(way):
            if letter == "." and way[:at] in value:
                return _cells(value[way[:at]], way[at + 1 :])
        raise KeyError(way)
    if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        cells = [_cell(item, way) for item in value]
        if all(cell is None for cell in cells):
            raise KeyError(way)
        return cells
    raise KeyError(way)


def _cell(record: Any, way: str) -> Any:
    """Return a value of a record, None where it has none."""
    try:
        return _cells(record, way)
    except KeyError:
        return None


def _names(value: Any, before: str = "", depth: int = 0) -> Iterable[str]:
    """Yield the ways that a document has, of a list of records those of the first."""
    if isinstance(value, list):
        value = value[0] if value and isinstance(value[0], dict) else {}
    for name, inside in value.items() if isinstance(value, dict) else ():
        way = f"{before}{name}"
        below = list(_names(inside, f"{way}.", depth + 1)) if depth < _DEEPEST else []
        yield from below or [way]


def _element(cell: Any, place: ElementAddress, column: str, at: int) -> Any:
    assert place.index is not None
    if not isinstance(cell, list) or place.index >= len(cell):
        raise ValueError(
            f"sample {at + 1}, column {column!r} is {quote(cell)}, expected a list of more than {place.index}"
        )
    return cell[place.index]


def _number(cell: Any, place: ElementAddress, column: str, at: int) -> float:
    """Return a number, NaN for null. Raises ValueError for anything else."""
    if cell is None:
        return math.nan
    if place.index is not None and not place.is_row:
        cell = _element(cell, place, column, at)
    if cell is None:
        return math.nan
    if isinstance(cell, (int, float)) and not abs(cell) >= 1e308:
        return float(cell)
    hint = f": {column}[0]" if isinstance(cell, list) else ""
    raise ValueError(
        f"sample {at + 1}, column {brief(column)!r} is {quote(cell)}, expected a finite number{hint}"
    )
