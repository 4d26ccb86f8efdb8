"""Vectors, matrices and structs out of MAT files, read in another process (see `_mat_reader.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msg_adapters.tables.child import Reader
from msg_adapters.tables.column_table import LARGEST, Table

CHILD = Path(__file__).with_name("_mat_reader.py")
TIME = 90.0
"""s. The largest file that is read takes 3 s."""
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_mat(path: Path, columns: Sequence[str]) -> Table:
    """Return the requested variables. Raises OSError and ValueError with variable, shape and expectation."""
    _refuse_version_7_3(path)
    return Reader("MAT", CHILD, TIME, LARGEST).read(path, columns)


def _refuse_version_7_3(path: Path) -> None:
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 7.3") or _HDF5 in (head[:8], head[512:]):
        raise ValueError("MAT file of version 7.3 (HDF5), expected version 7: save(…, '-v7') in MATLAB")
