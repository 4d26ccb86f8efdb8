"""A text table: its layout and its numerals, and how it is read line by line."""

import codecs
import csv
import gzip
import io
import re
import stat
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime, timedelta, timezone
from itertools import chain, product
from pathlib import Path
from typing import IO, cast

import numpy as np

from msg_adapters.tables import column_table
from msg_adapters.tables.column_table import Labels, Table, Wanted, base_and_index, index_of
from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.wording import brief, quote
from rsea_ros.records.record import FloatArray

_FORTRAN = re.compile(r"([-+]?[0-9.]+)[dD]([-+]?[0-9]+)")
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+([eEdD][-+]?[0-9]+)?")
_DATE_TIME = re.compile(
    r"([0-9]{4})[-/]([0-9]{2})[-/]([0-9]{2})[T ]+([0-9]{2}):([0-9]{2}):([0-9]{2})(?:[.,]([0-9]+))?"
    r" ?(?:(?:Z|UTC|GMT)|([+-][0-9]{2}):?([0-9]{2})?)?"
)


def numeral(cell: str, decimal: str = ".") -> str:
    """Return a cell as a plain decimal is written; unchanged where it is no number."""
    if decimal == "," and DECIMAL_COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    return _FORTRAN.sub(r"\1e\2", cell) if _FORTRAN.fullmatch(cell) else cell


def seconds_of(cell: str) -> float | None:
    """Return an ISO 8601 date-time as s since 1970, None for anything else; without a zone it is UTC.

    Raises ValueError for a date or a time that there is not.
    """
    match = _DATE_TIME.fullmatch(cell)
    if match is None:
        return None
    *fields, fraction, hours, minutes = match.groups()
    zone = timezone(timedelta(hours=int(hours or 0), minutes=int(f"{(hours or '+')[0]}{minutes or 0}")))
    try:
        year, month, day, hour, minute, second = map(int, fields)
        whole = datetime(year, month, day, hour, minute, second, tzinfo=zone).timestamp()
    except ValueError as error:
        raise ValueError(f"{error}, expected a date-time") from None
    return whole + float(f"0.{fraction or 0}")


COMMENTS = ("#", "%")
BLANKS = " "
"""As delimiter: one or several blanks or tabs."""
DELIMITERS = {",": ",", ";": ";", "\t": "\t", "|": "|", " ": BLANKS, "tab": "\t", "blanks": BLANKS}
"""What a map may say, and what is meant."""


@dataclass(frozen=True)
class TextLayout:
    """names: of the columns. headed: whether they are in the first valid line."""

    delimiter: str
    names: tuple[str, ...]
    headed: bool

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line; a delimiter at its end begins no further cell."""
        cells = split(line, self.delimiter)
        return cells[:-1] if len(cells) == len(self.names) + 1 and not cells[-1] else cells

    def fits(self, line: str) -> bool:
        """Return whether a line without quotes has a cell for every name."""
        if self.delimiter == BLANKS:
            return len(line.split()) == len(self.names)
        extra = line.count(self.delimiter) + 1 - len(self.names)
        return extra == 0 or (extra == 1 and line.rstrip(" ").endswith(self.delimiter))


def counts(line: str) -> bool:
    """Return whether a line is neither empty nor a comment."""
    text = line.strip()
    return bool(text) and not text.startswith(COMMENTS)


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks and quotes around them."""
    if delimiter == BLANKS:
        return [cell.strip('"') for cell in line.split()]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _is_number(column: str, names: Sequence[str]) -> bool:
    """Return whether a column is asked for by its number, from 1."""
    return column not in names and column.isdecimal() and 1 <= int(column[:6]) <= len(names)


def layout_of(
    lines: Sequence[str], comments: Sequence[str], wanted: Wanted, path: Path
) -> tuple[int, TextLayout]:
    """Return which of the first lines that count begins the table, and the layout by it.

    wanted.header: whether that line names the columns; None: if no delimiter makes numbers of all of it. It
    is the first line, or below a preamble the first that names all requested columns; a comment above may
    name the columns of numbers. Without a delimiter it is the first of several with which the line has the
    requested columns; otherwise the one that yields most of them, and of these the one that makes most cells.
    A comma between cells of decimal commas, which are quoted then, comes last.
    """
    columns, header = wanted.columns, wanted.header
    usual = "\t" if ".tsv" in path.suffixes else ","
    known = sorted(dict.fromkeys((usual, "\t", ";", ",", "|", BLANKS)), key=lambda one: one == wanted.decimal)
    tried = [wanted.delimiter] if wanted.delimiter else known
    layouts = [_layout(lines, one, wanted) for one in tried]
    above = [text for line in reversed(comments) for text in (line.lstrip(" \t#%"), line)]
    for layout in (one for one in layouts if not one.headed or any(map(is_decimal, one.names))):
        for line, one in product(above, known):  # as numpy.savetxt(header=…), rostopic write them
            named = TextLayout(layout.delimiter, tuple(split(line, one)), False)
            if len(named.names) == len(layout.names) and all(_names(named, column) for column in columns):
                return 0, named
    for layout in sorted(layouts, key=lambda layout: layout.headed):
        if all(_has(layout, column) for column in columns):
            return 0, layout
    for at in range(1, len(lines) if header is not False else 0):
        for layout in (_layout(lines[at:], one, wanted) for one in tried):
            if layout.headed and all(_names(layout, column) for column in columns):
                return at, layout
    return 0, max(layouts, key=lambda one: (sum(_names(one, column) for column in columns), len(one.names)))


def _names(layout: TextLayout, column: str) -> bool:
    return base_and_index(column, layout.names)[0] in layout.names


def _has(layout: TextLayout, column: str) -> bool:
    base, _ = base_and_index(column, layout.names)
    return base in layout.names or _is_number(base, layout.names)


def _layout(lines: Sequence[str], delimiter: str, wanted: Wanted) -> TextLayout:
    """Return the layout by the first of some lines; unnamed columns at its end are those that hold values."""
    cells, header = split(lines[0], delimiter), wanted.header
    is_numbered = all(column.isdecimal() for column in wanted.columns)
    if is_numbered or not cells[-1:] or not cells[-1]:
        width = max((_width(split(line, delimiter)) for line in lines[1:]), default=0)
        cells = cells[: max(width, _width(cells), 1)]
        cells += [""] * (width - len(cells)) if is_numbered else []
    is_data = all(is_decimal(numeral(cell, ",")) or _DATE_TIME.fullmatch(cell) for cell in cells if cell)
    if is_data if header is None else not header:
        return TextLayout(delimiter, tuple(str(number + 1) for number in range(len(cells))), headed=False)
    return TextLayout(delimiter, tuple(cells), headed=True)


def _width(cells: Sequence[str]) -> int:
    """Return how many cells there are up to the last that is not empty."""
    return max((at for at, cell in enumerate(cells, 1) if cell), default=0)


BLOCK = 1 << 22
"""Characters that are held at a time."""
LONGEST = 1 << 20
"""Characters of a line. A table of numbers has some hundred."""
_HEAD = 1 << 16
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


def blocks_of_lines(path: Path) -> Iterator[list[str]]:
    """Yield the lines of a file without their ends. Raises ValueError for a file that is not text."""
    rest = ""
    with _open(path) as file:
        text = io.TextIOWrapper(cast("IO[bytes]", file), encoding=_encoding(path), errors="replace")
        while chunk := text.read(BLOCK):
            lines = (rest + chunk).split("\n")
            rest = lines.pop()
            if len(rest) > LONGEST:
                raise ValueError(f"a line of more than {LONGEST} characters, expected a table of numbers")
            yield lines
    if rest:
        yield [rest]


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes] | gzip.GzipFile]:
    if stat.S_ISFIFO(path.stat().st_mode):
        raise ValueError("is a pipe, expected a file")
    with gzip.open(path, "rb") if path.suffix == ".gz" else path.open("rb") as file:
        yield file


def _encoding(path: Path) -> str:
    """Return the encoding: by its mark, else UTF-8 where the beginning is that, else Latin-1."""
    with _open(path) as file:
        head = file.read(_HEAD)
    for mark, name in _MARKS.items():
        if head.startswith(mark):
            return name
    if b"\0" in head:
        raise ValueError("not a text (it has zero bytes), expected CSV or TSV in UTF-8")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


MISSING = {"", "-", "--", "na", "n/a", "#n/a", "nan", "nil", "none", "null"}
"""What stands, in small letters, where there is no value."""
_FIRST_OF_NUMBERS = frozenset("0123456789+-.")
_LONGEST = 200
"""Characters of a line in a note."""
MOST_LEFT_OUT = 0.1
"""Of the rows. With more of them the table is not what its first line says."""
_PREAMBLE = 100
"""Lines that count among which the names of the columns are sought."""


def read_text(path: Path, wanted: Wanted) -> Table:
    """Return the requested columns. Raises ValueError with line, column, value and expectation.

    Lines above the names of the columns, and one of units below them, are left out with a note.
    """
    comments, head = _head(path)
    if not head:
        raise ValueError("empty file, expected a row of column names and rows of numbers")
    at, layout = layout_of([line for _, line in head], comments, wanted, path)
    first, notes = head[at][0] + layout.headed, tuple[str, ...]()
    if at:
        notes = (f"lines {head[0][0]} to {head[at - 1][0]} above the names of the columns are left out",)
    reader = _Reader(layout, wanted)
    if layout.headed and head[at + 1 :] and is_row_of_texts(layout.cells(head[at + 1][1])):
        number, line = head[at + 1]
        first, notes = number + 1, (*notes, f"line {number} is taken for the units: {brief(line, _LONGEST)}")
    number = 1
    for lines in blocks_of_lines(path):
        rows = [row for row in enumerate(lines, number) if row[0] >= first and counts(row[1])]
        reader.add(rows)
        number += len(lines)
    return replace(reader.table(), notes=notes)


def column_names(path: Path) -> tuple[dict[str, str], str]:
    """Return what a row of units says of each column, by number where a name is not its own; the delimiter.

    The table begins where the next lines have as many cells. Raises ValueError where it nowhere does.
    """
    comments, head = _head(path)
    lines = [line for _, line in head]
    wishes = [Wanted((), delimiter=one) for one in dict.fromkeys(DELIMITERS.values())]
    for at in range(len(lines) - 1):
        tried = [layout_of(lines[at:], comments, wanted, path)[1] for wanted in wishes]
        for layout in sorted(tried, key=lambda one: -sum(map(bool, one.names))):
            below = [layout.cells(line) for line in lines[at + 1 : at + 4]]
            if len(layout.names) < 2 or any(len(cells) != len(layout.names) for cells in below):
                continue
            once = [name if layout.names.count(name) == 1 else "" for name in layout.names]
            names = [name or str(number) for number, name in enumerate(once, 1)]
            units = below[0] if is_row_of_texts(below[0]) else [""] * len(names)
            return dict(zip(names, units, strict=True)), layout.delimiter
    raise ValueError("no rows of the same number of cells, expected a table with two columns or more")


def is_row_of_texts(cells: Sequence[str]) -> bool:
    """Return whether a row has texts and neither a number nor a list: the units of its columns."""
    filled = [cell for cell in cells if cell.lower() not in MISSING]
    return bool(filled) and not any(cell[0] in _FIRST_OF_NUMBERS or "," in cell for cell in filled)


def _head(path: Path) -> tuple[list[str], list[tuple[int, str]]]:
    """Return the comments above the first line that counts, and the first that do, with their numbers."""
    comments: deque[str] = deque(maxlen=_PREAMBLE)
    head: list[tuple[int, str]] = []
    for number, line in enumerate(chain.from_iterable(blocks_of_lines(path)), 1):
        if counts(line):
            head.append((number, line))
        elif not head:
            comments.append(line)
        if len(head) == _PREAMBLE:
            break
    return list(comments), head


class _Reader:
    """Collects columns block by block."""

    def __init__(self, layout: TextLayout, wanted: Wanted) -> None:
        self._layout = layout
        self._decimal, self._labels, self._stamps = wanted.decimal, wanted.labels, wanted.stamps
        self._dated: set[str] = set()
        places = {column: base_and_index(column, layout.names) for column in wanted.columns}
        by = {c: (base, _is_number(base, layout.names)) for c, (base, _) in places.items()}
        self._indices = {c: int(b) - 1 if n else index_of(b, layout.names) for c, (b, n) in by.items()}
        self._elements = {column: element for column, (_, element) in places.items()}
        self._has_lists = any(element is not None for element in self._elements.values())
        self._parts: dict[str, list[FloatArray | Labels]] = {column: [] for column in self._indices}
        self._rows, self._left_out, self._first = 0, 0, ""

    def add(self, rows: list[tuple[int, str]]) -> None:
        """Take a block of lines that count."""
        if not rows:
            return
        self._rows += len(rows)
        column_table.check_size(self._rows, len(self._indices))
        values = None if self._has_lists else self._fast([line for _, line in rows])
        cells = self._careful(rows) if values is None else values.T
        for parts, part in zip(self._parts.values(), cells, strict=True):
            parts.append(np.ascontiguousarray(part))

    def table(self) -> Table:
        """Return the collected table. Raises ValueError where it is not a table."""
        if not self._rows:
            raise ValueError("no rows, expected numbers below the column names")
        if self._left_out > MOST_LEFT_OUT * self._rows:
            both = self._layout.delimiter == self._decimal
            unnamed = ": if a column has no name, number all columns" if self._left_out == self._rows else ""
            hint = ": cells of numbers with decimal commas need quotes between commas" if both else unnamed
            raise ValueError(f"{self._first}, as in {self._left_out} of {self._rows} rows{hint}")
        columns: dict[str, FloatArray] = {}
        labels: dict[str, Labels] = {}
        for column, parts in self._parts.items():
            sign = self._decimal
            plain = [[numeral(c, sign) for c in p] if p.dtype.kind == "U" else p for p in parts]
            texts = [cell for part in plain for cell in part if isinstance(cell, str)]
            if all(is_decimal(cell) or not cell for cell in texts):
                whole = [[c or "nan" for c in p] if isinstance(p, list) else p for p in plain]
                columns[column] = np.concatenate([np.asarray(part, np.float64) for part in whole])
            else:
                cells = [c if isinstance(c, str) else f"{c:.15g}" for part in parts for c in part]
                labels[column] = np.array(cells, np.str_)
            parts.clear()
        dated = frozenset(self._dated)
        return Table(columns, self._rows, self._left_out, self._first, labels=labels, dated=dated)

    def _fast(self, lines: list[str]) -> FloatArray | None:
        """Return the values of a block of plain numbers only, otherwise None."""
        layout = self._layout
        if not all(layout.fits(line) for line in lines):
            return None
        delimiter = None if layout.delimiter == BLANKS else layout.delimiter
        indices = list(self._indices.values())
        if self._decimal == "," and delimiter != ",":
            lines = [line.replace(",", ".") for line in lines]
        try:
            table = np.loadtxt(lines, delimiter=delimiter, usecols=indices, comments=None, ndmin=2)
        except ValueError:
            return None
        return table if len(table) == len(lines) and np.isfinite(table).all() else None

    def _careful(self, rows: list[tuple[int, str]]) -> list[FloatArray | Labels]:
        """Return the columns of a block, NaN for missing values, without rows that have too few cells."""
        kept: list[list[float | str]] = []
        for number, line in rows:
            cells = self._layout.cells(line)
            if len(cells) == len(self._layout.names):
                kept.append([self._value(number, name, cells[at]) for name, at in self._indices.items()])
                continue
            self._left_out += 1
            expected = len(self._layout.names)
            self._first = self._first or f"line {number} has {len(cells)} fields, expected {expected}"
        columns = zip(*kept, strict=True) if kept else [()] * len(self._indices)
        return [
            np.array(column, np.str_ if name in self._labels else np.float64)
            for name, column in zip(self._indices, columns, strict=True)
        ]

    def _value(self, line: int, column: str, cell: str) -> float | str:
        element = self._elements[column]
        if column in self._labels:
            return "" if cell.lower() in MISSING else cell
        if column in self._stamps and (seconds := _seconds(line, column, cell)) is not None:
            self._dated.add(column)
            return seconds
        if element is None:
            return _value(line, column, cell, self._decimal)
        try:
            number = column_table.number_in(cell, element)
        except ValueError as error:
            raise ValueError(f"line {line}, column {column!r} is {quote(cell)}, {error}") from None
        return _value(line, column, number, self._decimal)


def _value(line: int, column: str, cell: str, decimal: str) -> float:
    number = cell if is_decimal(cell) else numeral(cell, decimal)
    if is_decimal(number):
        return float(number)
    if cell.lower() in MISSING:
        return float("nan")
    has_comma = DECIMAL_COMMA.fullmatch(cell)
    hint = ', with a decimal point (or `decimal: ","` in the map)' if has_comma else ""
    raise ValueError(f"line {line}, column {column!r} is {quote(cell)}, expected a finite number{hint}")


def _seconds(line: int, column: str, cell: str) -> float | None:
    try:
        return seconds_of(cell)
    except ValueError as error:
        raise ValueError(f"line {line}, column {column!r} is {quote(cell)}: {error}") from None
