"""Columns of numbers out of files, each format by the end of the file's name."""

import csv
import gzip
import zlib
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from msg_adapters.tables import json_file
from msg_adapters.tables.child import read_apart
from msg_adapters.tables.column_table import LARGEST, Table, Wanted
from msg_adapters.tables.json_file import read_json
from msg_adapters.tables.npz_file import read_npy, read_npz
from msg_adapters.tables.text_file import read_text
from rsea_ros.errors import ImportMapError

MAT, PARQUET = (Path(__file__).with_name(f"_{name}_reader.py") for name in ("mat", "parquet"))
HDF5 = b"\x89HDF\r\n\x1a\n"
_MAT_HEADER = 128
"""Bytes before the first variable."""


def read_mat(path: Path, wanted: Wanted) -> Table:
    """Return the requested variables. Raises OSError and ValueError with variable, shape and expectation."""
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 7.3") or HDF5 in (head[:8], head[512:]):
        raise ValueError(
            "MAT file of version 7.3 (HDF5), expected version 7: save(…, '-v7') in MATLAB, or docs/import.md"
        )
    _refuse_cut_off(path)
    return read_apart("MAT", MAT, LARGEST, path, wanted.columns)


def _refuse_cut_off(path: Path) -> None:
    """Raise ValueError for a file of version 5 to 7 whose last variable goes on beyond its end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_MAT_HEADER)
        if not head.startswith(b"MATLAB 5.0") or head[126:128] not in (b"IM", b"MI"):
            return
        order: Literal["little", "big"] = "little" if head[126:128] == b"IM" else "big"
        while tag := file.read(8):
            end = file.tell() + int.from_bytes(tag[4:8], order)
            if len(tag) < 8 or end > size:
                raise ValueError(f"MAT file cut off at {size} bytes, expected {end} or more: copy it again")
            file.seek(end)


def read_parquet(path: Path, wanted: Wanted) -> Table:
    """Return the requested columns. Raises OSError and ValueError with column, type and expectation."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise ValueError("no Parquet file (it does not begin with PAR1), expected one")
    if find_spec("pyarrow") is None:
        raise ValueError(
            "Parquet needs the package pyarrow, which is not installed: pip install 'rsea_ros[fleet]'"
        )
    return read_apart("Parquet", PARQUET, LARGEST, path, wanted.columns)


READERS: Mapping[str, Callable[[Path, Wanted], Table]] = {
    ".mat": read_mat,
    ".npz": read_npz,
    ".npy": read_npy,
    ".parquet": read_parquet,
    ".pq": read_parquet,
    ".json": read_json,
    **dict.fromkeys(json_file.LINES, read_json),
}
"""By suffix; a file with any other is text: CSV, TSV, blanks between numbers, gzipped or not."""


def read_columns(path: Path, columns: Sequence[str], **options: Any) -> Table:
    """Return the requested columns. options: those of Wanted.

    Text files name their columns in the first row, below a preamble at most, or in a comment above the
    numbers; without names they are called 1, 2, ….
    Raises ImportMapError with file, line, column, value and expectation.
    """
    wanted = Wanted(tuple(columns), **options)
    reader = READERS.get(path.suffix.lower())
    try:
        if reader:
            return reader(path, wanted)
        refuse_foreign(path)
        return read_text(path, wanted)
    except IsADirectoryError:
        raise ImportMapError(
            f"{path}: is a directory, expected a file; only a map with `file:` reads a directory"
        ) from None
    except (gzip.BadGzipFile, zlib.error, EOFError):
        raise ImportMapError(f"{path}: damaged or no gzip file, expected a packed table") from None
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror or error}") from None
    except (ValueError, csv.Error) as error:
        raise ImportMapError(f"{path}: {' '.join(str(error).split())}") from None


_AS_NPZ = "write its columns to NPZ with numpy.savez (docs/import.md)"
_KINDS: tuple[tuple[bytes, str, str], ...] = (
    (HDF5, "an HDF5 file", _AS_NPZ),
    (b"PK\x03\x04", "a spreadsheet or another zip archive", "save the sheet as CSV, or unpack it"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook", "save the sheet as CSV"),
    (b"ARROW1", "an Arrow (Feather) file", "write it as Parquet with pyarrow.parquet.write_table"),
    (b"PAR1", "a Parquet file", "call it .parquet"),
    (b"#ROSBAG V2.0", "a bag of ROS 1", "it needs no import: name it in place of a bag"),
    (b"\x89MCAP", "a bag", "it needs no import: name it in place of a bag"),
    (b"SQLite format 3", "a database", "a bag (.db3) needs no import; export a table as CSV"),
    (b"\x93NUMPY", "an NPY file", "call it .npy"),
    (b"MATLAB 5.0", "a MAT file", "call it .mat"),
    (b"\x80\x04", "a pickle, which may run any program", _AS_NPZ),
    (b"\x80\x05", "a pickle, which may run any program", _AS_NPZ),
    (b"\x80\x02", "a pickle, which may run any program", _AS_NPZ),
    (b"CDF\x01", "a netCDF file", _AS_NPZ),
    (b"CDF\x02", "a netCDF file", _AS_NPZ),
)
"""First bytes, kind, and what a person can do."""
_TAR, _TAR_AT = b"ustar", 257
_LONGEST = _TAR_AT + len(_TAR)
_ZARR = (".zgroup", ".zarray", "zarr.json")
"""Headers of zarr 2 and 3; the command reads both, with the user's zarr."""
_ZARR_TO_NPZ = (
    """python -c 'import numpy, zarr; numpy.savez("run.npz", **dict(zarr.open("FOLDER").arrays()))'"""
)


def refuse_foreign(path: Path) -> None:
    """Raise ValueError with kind and remedy for a zarr group, and a file whose first bytes are no text's."""
    if any((path / name).is_file() for name in _ZARR):
        raise ValueError(f"is a zarr group, expected a table: convert it to NPZ by {_ZARR_TO_NPZ}")
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_LONGEST)
    for start, kind, remedy in _KINDS:
        if head.startswith(start):
            raise ValueError(f"is {kind}, expected a table: {remedy}")
    if head[_TAR_AT:] == _TAR:
        raise ValueError("is a tar archive, expected a table: unpack it, and import a file of it")
