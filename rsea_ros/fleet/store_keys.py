"""The content of a store: the keys of its rows, and the bags that they came from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from rsea_ros.fleet.row import key_of

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
    """Return some columns of one file, all by default, without those in its path."""
    with parquet.ParquetFile(file) as opened:
        return opened.read(columns=columns)


def metadata(file: Path) -> dict[Any, Any]:
    """Return the metadata of a file."""
    return dict(parquet.read_schema(file).metadata or {})
