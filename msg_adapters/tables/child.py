"""A reader in a process of its own, and the elements that it returns.

`_readers.py` gets FORMAT, FILE, the largest number of values and the places of the columns in JSON, and
answers with a line of JSON, {"sizes": …} in the order of the columns, {"column": …, "names": …} for one that
the file has not, or {"error": …}; then the numbers, as doubles.

`name[1]` is the second number of each sample: of a list in a cell, or a column of a matrix. `name[1,:]` is
a row of a matrix whose samples lie side by side; MATLAB's `name(:,2)` and `name(2,:)` are the same two.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from msg_adapters.tables.column_table import Table, checked_lengths, index_of
from rsea_ros.documents.wording import quote
from rsea_ros.records.record import FloatArray

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


PROGRAM = Path(__file__).with_name("_readers.py")
SECONDS = 90.0
"""After which a reader is ended: its own ceiling is processor time. The largest MAT file takes 3 s, three
columns of ten million rows of Parquet 2 s."""


def read_apart(name: str, limit: int, path: Path, columns: Sequence[str]) -> Table:
    """Return the requested columns, read by another process.

    name: of the format. limit: of the values. Raises ValueError with column, shape and expectation.
    """
    places = json.dumps([{"column": column, **asdict(place_of(column))} for column in columns])
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    command = [sys.executable, "-I", str(PROGRAM), name, str(path.absolute()), str(limit), places]
    with tempfile.TemporaryFile() as output:
        try:
            code = subprocess.run(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.DEVNULL,
                env=environment, timeout=SECONDS, check=False,
            ).returncode  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ValueError(f"could not be read within {SECONDS:g} s") from None
        if code:
            end = signal.Signals(-code).name if code < 0 else f"status {code}"
            raise ValueError(f"could not be read: the {name} reader ended with {end}; a damaged file?")
        output.seek(0)
        try:
            answer = json.loads(output.readline())
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            raise ValueError(f"could not be read: the {name} reader gave no answer; a damaged file?")
        if "names" in answer:
            index_of(answer["column"], answer["names"])
        if "sizes" not in answer:
            raise ValueError(quote(str(answer.get("error")), 200)[1:-1])
        sizes = dict(zip(columns, answer["sizes"], strict=True))
        checked_lengths(sizes)
        return finite_table({column: _vector(output, size) for column, size in sizes.items()})


def _vector(output: IO[bytes], size: int) -> FloatArray:
    """Return the next doubles. They are read into place: through `read` they would lie in memory twice."""
    vector = np.empty(size, "<f8")
    if output.readinto(vector.view(np.uint8)) != 8 * size:  # type: ignore[attr-defined]
        raise ValueError("could not be read: the reader gave too few numbers; a damaged file?")
    return vector


def finite_table(vectors: dict[str, FloatArray], **more: Any) -> Table:
    """Return a table of vectors of one length. more: its other fields. Raises ValueError for infinity."""
    checked_lengths({name: vector.size for name, vector in vectors.items()})
    for name, vector in vectors.items():
        at = int(np.argmax(np.isinf(vector)))
        if np.isinf(vector[at]):
            raise ValueError(f"{name}[{at}] is {vector[at]}, expected a finite number")
    return Table(vectors, next(iter(vectors.values())).size, **more)
