"""Columns of numbers from a file, and their missing values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.records.record import FloatArray

LARGEST = 100_000_000
"""Numbers in all columns that are asked for: 0.8 GB."""
_LONGEST_LIST = 40


@dataclass(frozen=True)
class Table:
    """Columns by name, shape (n,) each, n > 0; NaN where a cell was empty or `nan`.

    rows: of the file, those that were left out included. left_out: how many of them had too few or too
    many fields. first: place of the first of these, for people. notes: lines of the file that are no rows.
    """

    columns: Mapping[str, FloatArray]
    rows: int
    left_out: int = 0
    first: str = ""
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]


def index_of(column: str, names: Sequence[str]) -> int:
    """Return where a column stands. Raises ValueError where it stands nowhere or twice."""
    if column not in names:
        more = f" and {len(names) - _LONGEST_LIST} more" if len(names) > _LONGEST_LIST else ""
        listed = ", ".join(quote(name)[1:-1] for name in names[:_LONGEST_LIST])
        joint = " (--index puts the number of a joint in the place of #)" if "#" in column else ""
        near = did_you_mean(column, names)
        raise ValueError(f"no column {column!r}{joint}, expected one of {listed}{more}{near}")
    if list(names).count(column) > 1:
        places = ", ".join(str(i + 1) for i, name in enumerate(names) if name == column)
        raise ValueError(
            f"column {column!r} stands {list(names).count(column)} times ({places}), expected once"
        )
    return list(names).index(column)


def checked_lengths(sizes: Mapping[str, int]) -> None:
    """Raise ValueError for columns of unequal length. sizes: by column."""
    if len(set(sizes.values())) > 1:
        raise ValueError(
            f"vectors of unequal length {dict(sizes)}, expected one sample each at every stamp"
        )


def check_size(rows: int, columns: int) -> None:
    """Raise ValueError for more numbers than are read."""
    if rows * columns > LARGEST:
        raise ValueError(
            f"more than {LARGEST // columns} rows of {columns} columns, expected a shorter record"
        )
