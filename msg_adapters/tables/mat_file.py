"""Vectors, matrices and structs out of MAT files, read in another process (see `_mat_reader.py`)."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from msg_adapters.tables.child import Reader
from msg_adapters.tables.column_table import LARGEST, Table, Wanted

HDF5 = b"\x89HDF\r\n\x1a\n"
CHILD = Path(__file__).with_name("_mat_reader.py")
TIME = 90.0
"""s. The largest file that is read takes 3 s."""
_HEADER = 128
"""Bytes before the first variable."""


def read_mat(path: Path, wanted: Wanted) -> Table:
    """Return the requested variables. Raises OSError and ValueError with variable, shape and expectation."""
    _refuse_version_7_3(path)
    _refuse_cut_off(path)
    return Reader("MAT", CHILD, TIME, LARGEST).read(path, wanted.columns)


def _refuse_version_7_3(path: Path) -> None:
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 7.3") or HDF5 in (head[:8], head[512:]):
        raise ValueError(
            "MAT file of version 7.3 (HDF5), expected version 7: save(…, '-v7') in MATLAB, or docs/import.md"
        )


def _refuse_cut_off(path: Path) -> None:
    """Raise ValueError for a file of version 5 to 7 whose last variable goes on beyond its end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER)
        if not head.startswith(b"MATLAB 5.0") or head[126:128] not in (b"IM", b"MI"):
            return
        order: Literal["little", "big"] = "little" if head[126:128] == b"IM" else "big"
        while tag := file.read(8):
            end = file.tell() + int.from_bytes(tag[4:8], order)
            if len(tag) < 8 or end > size:
                raise ValueError(f"MAT file cut off at {size} bytes, expected {end} or more: copy it again")
            file.seek(end)
