"""The row of a recording and a joint: its columns, and how it is written to a Parquet file.

The column `joint` is in the path of the file (joint=NAME/month=YYYY-MM), as every reader of partitioned
Parquet expects; its month is that of `time`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

SCHEMA = 1
"""Grows when a column changes its meaning; a store of a higher one is not read."""
Row = dict[str, Any]
UNDATED = "unknown"
"""Month of a recording whose time is not known."""


def _list_of(*fields: tuple[str, pa.DataType]) -> pa.DataType:
    return pa.list_(pa.struct([pa.field(name, kind) for name, kind in fields]))


_TEXT, _NUMBER = pa.string(), pa.float64()
_INTERVAL = (("name", _TEXT), ("value", _NUMBER), ("low", _NUMBER), ("high", _NUMBER), ("unit", _TEXT))
_CAUSE = (("name", _TEXT), ("status", _TEXT), ("probability", _NUMBER), ("gain", _NUMBER),
          ("sizes", _list_of(*_INTERVAL)))  # fmt: skip
COLUMNS: Mapping[str, pa.DataType] = {
    "recording": _TEXT,
    "bag": _TEXT,
    "time": pa.timestamp("us", tz="UTC"),
    "duration": _NUMBER,
    "temperature": _NUMBER,
    "excitation": _list_of(("name", _TEXT), ("value", _NUMBER), ("unit", _TEXT)),
    "faults": _list_of(("kind", _TEXT), ("count", pa.int64()), ("detail", _TEXT)),
    "outcome": _TEXT,
    "reason": _TEXT,
    "verdict": _TEXT,
    "diagnosis": _TEXT,
    "parameters": _list_of(*_INTERVAL, ("identifiable", pa.bool_())),
    "causes": _list_of(*_CAUSE),
    "residual": _NUMBER,
    "model_version": _TEXT,
    "settings": _TEXT,
    "schema": pa.int32(),
    "seconds": _NUMBER,
    "peak_memory": pa.int64(),
    "artefacts": _TEXT,
    "bytes": pa.int64(),
    "stamp": _TEXT,
    "written": pa.timestamp("us", tz="UTC"),
}
"""`joint` comes first, by the path. bytes, stamp: of the recording's files when it was read."""
VARYING = ("seconds", "peak_memory", "written", "stamp")
"""Columns in which two runs on the same recordings may differ."""
ARROW = pa.schema([pa.field(name, kind) for name, kind in COLUMNS.items()], {"rsea.schema": str(SCHEMA)})


def empty(joint: str, **stated: Any) -> Row:
    """Return a row of which only some columns are known."""
    lists: Row = {name: [] for name, kind in COLUMNS.items() if pa.types.is_list(kind)}
    texts = {name: "" for name, kind in COLUMNS.items() if kind == _TEXT}
    return {"joint": joint, **dict.fromkeys(COLUMNS), **lists, **texts, "schema": SCHEMA, **stated}


def analysis_of(model_version: str, settings: str) -> str:
    """Return the hash of software and settings of a row: 8 hexadecimal digits."""
    return hashlib.sha256(f"{model_version} {settings}".encode()).hexdigest()[:8]


def key_of(row: Mapping[str, Any]) -> str:
    """Return the unique key of a row: joint, recording, and hash of software and settings."""
    return f"{row['joint']}/{row['recording']}-{analysis_of(row['model_version'], row['settings'])}"


def month_of(time: datetime | None) -> str:
    """Return the month of a time as the store's folders say it."""
    return UNDATED if time is None else time.astimezone(timezone.utc).strftime("%Y-%m")


def write(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write rows of one partition as a Parquet file. Raises OSError."""
    columns = [pa.array([row[name] for row in rows], kind) for name, kind in COLUMNS.items()]
    write_table(pa.Table.from_arrays(columns, schema=ARROW), path)


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table of this schema. Raises OSError."""
    parquet.write_table(table, path, compression="zstd")
