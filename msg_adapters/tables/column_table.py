"""A table of columns with units, and the elements of a file that a column names.

`name[1]` is the second number of each sample: of a list in a cell, or a column of a matrix. `name[1,:]` is
a row of a matrix whose samples lie side by side; MATLAB's `name(:,2)` and `name(2,:)` are the same two.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.documents.units import same_unit
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.records.record import BoolArray, FloatArray

Labels = npt.NDArray[np.str_]
LARGEST = 100_000_000
"""Numbers in all columns that are asked for: 0.8 GB."""
_LONGEST_LIST = 40


@dataclass(frozen=True)
class Wanted:
    """What a map asks of a file.

    columns: each once. labels: those that choose rows, which may hold texts. stamps: those that may hold
    date-times. delimiter, header, decimal: of a text file, None where its lines tell.
    """

    columns: tuple[str, ...]
    labels: frozenset[str] = frozenset()
    stamps: frozenset[str] = frozenset()
    delimiter: str | None = None
    header: bool | None = None
    decimal: str = "."


@dataclass(frozen=True)
class Table:
    """Columns by name, shape (n,) each, n > 0; NaN where a cell was empty or `nan`.

    rows: of the file, those that were left out included. left_out: how many of them had too few or too
    many fields. first: place of the first of these, for people. notes: lines of the file that are no rows.
    labels: columns of texts, empty where a cell was. dated: columns of date-times, in s. trials: name of the
    list of trials that the rows come from, and the number of each row's.
    """

    columns: Mapping[str, FloatArray]
    rows: int
    left_out: int = 0
    first: str = ""
    notes: tuple[str, ...] = ()
    labels: Mapping[str, Labels] = field(default_factory=dict)
    dated: frozenset[str] = frozenset()
    trials: tuple[str, FloatArray] | None = None

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]

    def values(self, name: str) -> FloatArray | Labels:
        """Return a column of numbers or of texts."""
        return self.labels[name] if name in self.labels else self.columns[name]

    def given(self, name: str) -> BoolArray:
        """Return which rows have a value in a column."""
        if name in self.labels:
            return np.asarray(self.labels[name] != "")
        return ~np.isnan(self.columns[name])


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


def finite_table(vectors: dict[str, FloatArray], **more: Any) -> Table:
    """Return a table of vectors of one length. more: its other fields. Raises ValueError for infinity."""
    checked_lengths({name: vector.size for name, vector in vectors.items()})
    for name, vector in vectors.items():
        at = int(np.argmax(np.isinf(vector)))
        if np.isinf(vector[at]):
            raise ValueError(f"{name}[{at}] is {vector[at]}, expected a finite number")
    return Table(vectors, next(iter(vectors.values())).size, **more)


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


FACTORS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "arcmin": math.pi / 10800, "rev": 2 * math.pi},
    "angular velocity": {"rad/s": 1.0, "deg/s": math.pi / 180, "rev/s": 2 * math.pi, "rpm": 2 * math.pi / 60},
    "torque": {"N m": 1.0, "mN m": 1e-3, "N mm": 1e-3, "N cm": 1e-2, "kN m": 1e3},
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "current": {"A": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "number": {"1": 1.0},
}
"""By dimension: the units and what one of them is in SI."""

LINEAR: Mapping[str, str] = {"length": "angle", "velocity": "angular velocity", "force": "torque"}
"""What stands in for what where the machine is a linear drive: m for rad, N for N m."""

CHANNELS: Mapping[str, str] = {
    "command": "torque",
    "motor_torque": "torque",
    "ft": "torque",
    "deflection": "angle",
    "position": "angle",
    "velocity": "angular velocity",
    "reference": "angle",
    "reference_velocity": "angular velocity",
}
"""By channel of a record: its dimension."""


def unit(text: object) -> tuple[str, float]:
    """Return dimension and SI factor of a unit, however it is written; raises as canonical does."""
    name = canonical(text)
    return next((dimension, factors[name]) for dimension, factors in FACTORS.items() if name in factors)


def canonical(text: object) -> str:
    """Return the name of a unit in FACTORS: `Nm`, `N*m` and `N·m` are `N m`.

    Raises ValueError for an unknown one.
    """
    for factors in FACTORS.values():
        for name in factors:
            if same_unit(text, name):
                return name
    known = ", ".join(name for factors in FACTORS.values() for name in factors)
    raise ValueError(f"unit {quote(text)} unknown, expected one of {known}")
