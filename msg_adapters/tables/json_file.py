"""Columns out of JSON: records, `[{"t": 0, "q": [1, 2]}, …]`, or columns, `{"t": [0, …], "q": [[1, 2], …]}`.

A column is named by its way, `log.motor.current`, through mappings and lists of records. JSON lines
(`.jsonl`, `.ndjson`) are a list of records. A record whose values are long lists is a trial, whose other
values hold for all its samples; the way to the list of trials (`.`: the document) numbers them, from 1.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.tables import column_table
from msg_adapters.tables.column_table import ElementAddress, Table, Wanted, index_of, place_of
from msg_adapters.tables.text_file import seconds_of
from rsea_ros.documents.wording import brief, no_utf_8, quote

LARGEST_FILE = 200_000_000
"""Bytes: read as a whole, they take about eight times as much memory."""
LINES = (".jsonl", ".ndjson")
_SHORTEST_TRIAL = 20
"""Samples. Shorter lists are taken for the numbers of one sample."""
_DEEPEST = 4
"""Levels of names that a message lists."""


def read_json(path: Path, wanted: Wanted) -> Table:
    """Return the requested columns. Raises OSError and ValueError with column, sample and expectation."""
    if path.stat().st_size > LARGEST_FILE:
        raise ValueError(f"{path.stat().st_size} bytes of JSON, expected fewer than {LARGEST_FILE}")
    document = _document(path)
    places = {column: place_of(column) for column in wanted.columns}
    cells = {column: _cells_of(column, place, document) for column, place in places.items()}
    lengths = _trial_lengths({column: c for column, c in cells.items() if places[column].index is None})
    if lengths and all(isinstance(cells[column][0], list) for column in wanted.stamps):
        cells = {column: _spread(column, c, lengths) for column, c in cells.items()}
    else:
        lengths = []
    texts = [column for column in wanted.labels if any(isinstance(cell, str) for cell in cells[column])]
    labels = {c: np.array(["" if v is None else str(v) for v in cells[c]]) for c in texts}
    dated = frozenset(c for c in wanted.stamps if isinstance(cells[c][0], str))
    for c in dated - labels.keys():
        cells[c] = [seconds_of(cell) if isinstance(cell, str) else cell for cell in cells[c]]
    vectors = {
        c: np.array([_number(cell, places[c], c, at) for at, cell in enumerate(cells[c])], np.float64)
        for c in cells
        if c not in labels
    }
    column_table.check_size(len(next(iter(cells.values()))), len(cells))
    column_table.checked_lengths({column: len(c) for column, c in cells.items()})
    numbers = np.repeat(np.arange(1.0, len(lengths) + 1), lengths)
    trials = (_list_of(document, next(iter(places.values())).base), numbers) if lengths else None
    return column_table.finite_table(vectors, labels=labels, dated=dated, trials=trials)


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
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"key {quote(twice)} stands twice in a mapping, expected once")
    return mapping


def _cells_of(column: str, place: ElementAddress, document: Any) -> list[Any]:
    """Return the cells of a column, of the column that is a list of trials their numbers."""
    try:
        cells = _cells(document, "" if place.base == "." else place.base)
    except KeyError:
        index_of(column, list(dict.fromkeys(_names(document))))
        raise ValueError(f"column {column!r} is not a list of numbers, expected one") from None
    if place.is_row:
        cells = _element(cells, place, column, 0)
    if not isinstance(cells, list) or len(cells) < 2:
        raise ValueError(f"column {column!r} is {quote(cells)}, expected a list of numbers")
    return list(range(1, len(cells) + 1)) if all(isinstance(cell, dict) for cell in cells) else cells


def _trial_lengths(cells: Mapping[str, list[Any]]) -> list[int]:
    """Return how many samples each trial has; empty for samples that are no lists. Raises ValueError."""
    held = {column: c for column, c in cells.items() if all(isinstance(cell, list) for cell in c)}
    lengths = {column: [len(cell) for cell in c] for column, c in held.items()}
    for column, one in lengths.items():
        for at, (count, other) in enumerate(zip(one, next(iter(lengths.values())), strict=False), 1):
            if count != other:
                raise ValueError(f"trial {at}: {column} has {count} values, {next(iter(lengths))} {other}")
    found = next(iter(lengths.values()), [])
    return found if found and min(found) >= _SHORTEST_TRIAL else []


def _spread(column: str, cells: list[Any], lengths: Sequence[int]) -> list[Any]:
    """Return a cell for each sample: those of a trial's list, or the one value of the trial."""
    if len(cells) != len(lengths):
        raise ValueError(f"column {column!r} has {len(cells)} values, expected one for {len(lengths)} trials")
    each = zip(cells, lengths, strict=True)
    return [one for c, n in each for one in (c if isinstance(c, list) and len(c) == n else [c] * n)]


def _list_of(value: Any, way: str) -> str:
    """Return the way to the list of records that a way goes through, `.` for the document."""
    before = ""
    while not isinstance(value, list):
        name = max((n for n in value if way == n or way.startswith(f"{n}.")), key=len)
        value, way, before = value[name], way[len(name) + 1 :], f"{before}.{name}"
    return before.removeprefix(".") or "."


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
        cells: list[Any] = [None] * len(value)
        for at, item in enumerate(value):
            with suppress(KeyError):
                cells[at] = _cells(item, way)
        if any(cell is not None for cell in cells):
            return cells
    raise KeyError(way)


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
    if cell is not None and place.index is not None and not place.is_row:
        cell = _element(cell, place, column, at)
    if cell is None:
        return math.nan
    if isinstance(cell, (int, float)) and not abs(cell) >= 1e308:
        return float(cell)
    hint = f": {column}[0]" if isinstance(cell, list) else ""
    raise ValueError(
        f"sample {at + 1}, column {brief(column)!r} is {quote(cell)}, expected a finite number{hint}"
    )
