"""Cells that hold a list, `[0.1, -0.2, 0.3]`: `name[1]` is the second number of the column `name`."""

from __future__ import annotations

import re
from collections.abc import Sequence

CHOSEN = "#"
"""In the place of a number: the one that is chosen on import."""
_ELEMENT = re.compile(r"(?P<base>.+)\[(?P<index>[0-9]{1,4})\]")


def base_and_index(column: str, names: Sequence[str]) -> tuple[str, int | None]:
    """Return the column of a file that holds what is asked for, and which number of its cells.

    A column that is called `name[1]` itself is taken as it is.
    """
    found = _ELEMENT.fullmatch(column)
    if found is None or column in names:
        return column, None
    return found["base"], int(found["index"])


def number_in(cell: str, index: int) -> str:
    """Return a number of a cell that holds a list, as text. Raises ValueError where it has none there."""
    text = cell.strip()
    if not (text.startswith("[") and text.endswith("]")):
        raise ValueError("expected a list of numbers in brackets")
    numbers = [number.strip() for number in text[1:-1].split(",")]
    if index >= len(numbers):
        raise ValueError(f"a list of {len(numbers)} numbers, expected more than {index}")
    return numbers[index]


def chosen(column: str, index: int | None) -> str:
    """Return a column with the number that is chosen in the place of `#`."""
    return column if index is None else column.replace(f"[{CHOSEN}]", f"[{index}]")
