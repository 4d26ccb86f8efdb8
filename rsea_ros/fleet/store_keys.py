"""The content of a store: the keys of its rows, and the bags that they came from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from rsea_ros.documents.wording import brief
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.row import COLUMNS, key_of

EXPECTED_FILES = "expected whole Parquet files: remove the damaged one, and the next run makes its rows anew"
_LONGEST = 120
"""Characters of an error of Parquet."""
_COLUMNS = ["recording", "model_version", "settings", "bag", "bytes", "stamp"]


def known_rows(rows: Path) -> tuple[set[str], dict[tuple[str, int, str], str]]:
    """Return the keys of all rows, and the recording of every bag by path, bytes and stamp."""
    keys: set[str] = set()
    recordings: dict[tuple[str, int, str], str] = {}
    for file in rows.glob("joint=*/month=*/*.parquet"):
        joint = file.parent.parent.name.removeprefix("joint=")
        for row in read(file, _COLUMNS).to_pylist():
            keys.add(key_of({**row, "joint": joint}))
            recordings[row["bag"], row["bytes"], row["stamp"]] = row["recording"]
    return keys, recordings


def read(file: Path, columns: list[str] | None = None) -> pa.Table:
    """Return some columns of one file, all by default, without those in its path.

    Columns that an earlier version did not write are null. Raises FleetError for a damaged file.
    """
    with _named(file), parquet.ParquetFile(file) as opened:
        table = opened.read(columns=columns)
    for name in columns or COLUMNS:
        if name not in table.column_names:
            table = table.append_column(name, pa.nulls(len(table), COLUMNS[name]))
    return table


def metadata(file: Path) -> dict[Any, Any]:
    """Return the metadata of a file. Raises FleetError for a damaged file."""
    with _named(file):
        return dict(parquet.read_schema(file).metadata or {})


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Let an error of a damaged file name it."""
    try:
        yield
    except pa.ArrowInvalid as error:
        raise FleetError(f"{file}: {brief(str(error), _LONGEST)}, {EXPECTED_FILES}") from None
