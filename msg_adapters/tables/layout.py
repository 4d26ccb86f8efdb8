"""The layout of a text table, and its numerals."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from itertools import product
from pathlib import Path

from msg_adapters.tables.child import base_and_index
from msg_adapters.tables.column_table import Wanted, index_of
from rsea_ros.documents.strict_yaml import is_decimal

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


def index_in(column: str, names: Sequence[str]) -> int:
    """Return where a column stands, by its name or its number, from 1. Raises ValueError for neither."""
    return int(column) - 1 if _is_number(column, names) else index_of(column, names)


def _is_number(column: str, names: Sequence[str]) -> bool:
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
    for layout in (one for one in layouts if not one.headed):
        for line, one in product(reversed(comments), known):  # as numpy.savetxt(header=…) writes them
            named = TextLayout(layout.delimiter, tuple(split(line.lstrip(" \t#%"), one)), False)
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
