"""Columns that hold several numbers: lists in cells, matrices, arrays.

`name[1]` is the second number of each sample: of a list in a cell, or a column of a matrix. `name[1,:]` is
a row of a matrix whose samples lie side by side; MATLAB's `name(:,2)` and `name(2,:)` are the same two.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

CHOSEN = "#"
"""In the place of a number: the one chosen on import. Twice in a name: the number with two digits."""
_ELEMENT = re.compile(r"(?P<base>.+)\[(?:(?P<row>[0-9]{1,4}),:|(?::,)?(?P<column>[0-9]{1,4}))\]")
_MATLAB = re.compile(r"(?P<base>.+)\((?:(?P<row>[0-9]{1,4}),:|:,(?P<column>[0-9]{1,4}))\)")


@dataclass(frozen=True)
class ElementAddress:
    """Where the values of a column are: in `base`, all of it or number `index`, from 0.

    is_row: of the first axis (the samples are along the second), otherwise of the second.
    """

    base: str
    index: int | None = None
    is_row: bool = False


def place_of(column: str) -> ElementAddress:
    """Return the place that the name of a column says."""
    text = column.replace(" ", "") if column.endswith(("]", ")")) else column
    for pattern, first in ((_ELEMENT, 0), (_MATLAB, 1)):
        match = pattern.fullmatch(text)
        number = match and (match["row"] or match["column"])
        if match and number and int(number) >= first:
            return ElementAddress(match["base"], int(number) - first, match["row"] is not None)
    return ElementAddress(column)


def base_and_index(column: str, names: Sequence[str]) -> tuple[str, int | None]:
    """Return the column of a text file with the requested values, and the index within its cells.

    A column whose name is `name[1]` is used as such, and a number counts columns from 1.
    """
    if column in names:
        return column, None
    place = place_of(column)
    if place.index is None or place.is_row:
        return column, None
    return place.base, place.index


def number_in(cell: str, index: int) -> str:
    """Return a number of a cell that holds a list, as text. Raises ValueError where it is missing."""
    text = cell.strip()
    if not (text.startswith("[") and text.endswith("]")):
        raise ValueError("expected a list of numbers in brackets")
    numbers = [number.strip() for number in text[1:-1].split(",")]
    if index >= len(numbers):
        raise ValueError(f"a list of {len(numbers)} numbers, expected more than {index}")
    return numbers[index]


def choose_element(column: str, index: int | None) -> str:
    """Return a column, or an expression, with the chosen number in the place of each `##` and `#`.

    A `#` before a digit or a letter, as in `motor #1`, is a part of the name.
    """
    if index is None:
        return column
    column = column.replace(2 * CHOSEN, f"{index:02d}")
    return re.sub(r"#(?!\w)", str(index), column)


def is_open(text: str) -> bool:
    """Return whether a column or an expression still waits for a number in the place of `[#]` or `##`.

    A lone `#` may be a part of the name.
    """
    return 2 * CHOSEN in text or re.search(r"[\[,:]#[\],]", text) is not None
