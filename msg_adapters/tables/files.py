"""Columns of numbers out of CSV, TSV (each also gzipped) and MAT files."""

from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rsea_ros.errors import ImportMapError
from rsea_ros.signals import FloatArray

COMMENT = "#"


def read_columns(
    path: Path, columns: Sequence[str], delimiter: str | None = None
) -> Mapping[str, FloatArray]:
    """Return the columns asked for, shape (n,) each, n > 0, all finite.

    Text files name their columns in the first row; without names they are called 1, 2, ….
    Raises ImportMapError with file, row, column, value and expectation.
    """
    try:
        return _mat(path, columns) if path.suffix == ".mat" else _text(path, columns, delimiter)
    except (ValueError, NotImplementedError, zlib.error, EOFError) as error:
        raise ImportMapError(f"{path}: {' '.join(str(error).split())}") from None
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror or error}") from None


def _text(path: Path, columns: Sequence[str], delimiter: str | None) -> dict[str, FloatArray]:
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as file:
        content = file.read()
    delimiter = delimiter or ("\t" if ".tsv" in path.suffixes else ",")
    rows = csv.reader(io.StringIO(content), delimiter=delimiter)
    names = [cell.strip() for cell in next((row for row in rows if _counts(row)), [])]
    if not names:
        raise ValueError("empty file, expected a row of column names and rows of numbers")
    header = rows.line_num
    if all(_is_number(name) for name in names):
        names, header = [str(number + 1) for number in range(len(names))], 0
    indices = [_index(column, names) for column in columns]
    body = content.splitlines()[header:]
    if not any(line.strip() for line in body):
        raise ValueError("no rows, expected numbers below the column names")
    try:
        table = np.loadtxt(body, delimiter=delimiter, usecols=indices, comments=COMMENT, ndmin=2)
    except ValueError:
        table = np.full((1, 1), np.nan)
    if not np.isfinite(table).all():
        raise ValueError(
            _first_bad_cell(content, delimiter, header, dict(zip(columns, indices, strict=True)))
        )
    return {column: np.ascontiguousarray(table[:, at]) for at, column in enumerate(columns)}


def _first_bad_cell(content: str, delimiter: str, header: int, indices: Mapping[str, int]) -> str:
    """Say where the first cell is that is no finite number."""
    rows = csv.reader(io.StringIO(content), delimiter=delimiter)
    for row in rows:
        if rows.line_num <= header or not _counts(row):
            continue
        for column, index in indices.items():
            cell = row[index].strip() if index < len(row) else "missing"
            if not _is_number(cell) or not math.isfinite(float(cell)):
                return f"line {rows.line_num}, column {column!r} is {cell!r}, expected a finite number"
    return "not readable as a table of numbers"


def _counts(row: Sequence[str]) -> bool:
    return any(cell.strip() for cell in row) and not row[0].lstrip().startswith(COMMENT)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _index(column: str, names: Sequence[str]) -> int:
    if column not in names:
        raise ValueError(f"no column {column!r}, expected one of {', '.join(names)}")
    return list(names).index(column)


def _mat(path: Path, columns: Sequence[str]) -> dict[str, FloatArray]:
    from scipy.io import loadmat, matlab  # 0.2 s that text files need not wait for

    try:
        variables = {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    except matlab.MatReadError as error:
        raise ValueError(str(error)) from None
    table: dict[str, FloatArray] = {}
    for column in columns:
        _index(column, list(variables))
        values = np.asarray(variables[column])
        if values.dtype.kind not in "iufb" or values.size != max(values.shape, default=0) or values.size < 2:
            raise ValueError(
                f"variable {column!r} is {values.dtype} {values.shape}, expected a vector of numbers"
            )
        table[column] = values.ravel().astype(np.float64)
        if not np.isfinite(table[column]).all():
            at = int(np.flatnonzero(~np.isfinite(table[column]))[0])
            raise ValueError(f"{column}[{at}] is {table[column][at]}, expected a finite number")
    sizes = {column: values.size for column, values in table.items()}
    if len(set(sizes.values())) > 1:
        raise ValueError(f"vectors of unequal length {sizes}, expected one sample each at every stamp")
    return table
