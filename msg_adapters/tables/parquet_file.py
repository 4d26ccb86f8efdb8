"""Columns out of Parquet files, read in another process, a row group at a time (see `_parquet_reader.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from msg_adapters.tables.child import Reader
from msg_adapters.tables.column_table import LARGEST, Table

CHILD = Path(__file__).with_name("_parquet_reader.py")
TIME = 90.0
"""s. Three columns of ten million rows take 2 s."""


def read_parquet(path: Path, columns: Sequence[str]) -> Table:
    """Return the requested columns. Raises OSError and ValueError with column, type and expectation."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise ValueError("no Parquet file (it does not begin with PAR1), expected one")
    if find_spec("pyarrow") is None:
        raise ValueError(
            "Parquet needs the package pyarrow, which is not installed: pip install 'rsea_ros[fleet]'"
        )
    return Reader("Parquet", CHILD, TIME, LARGEST).read(path, columns)
