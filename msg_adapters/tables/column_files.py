"""Columns of numbers out of files, each format by the end of the file's name.

NPZ and NPY: no pickles, and the size of an array is known before it is read.

MAT and Parquet are read by a process of its own. `_readers.py` gets FORMAT, FILE, the largest number of
values and the places of the columns in JSON, and answers with a line of JSON, {"sizes": …} in the order of
the columns, {"column": …, "names": …} for one that the file has not, or {"error": …}; then the numbers, as
doubles.
"""

import csv
import gzip
import json
import os
import signal
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np
from numpy.lib import format as npy

from msg_adapters.tables import column_table, json_file
from msg_adapters.tables.column_table import LARGEST, ElementAddress, Table, Wanted, index_of, place_of
from msg_adapters.tables.text_file import read_text
from rsea_ros.documents.wording import brief, quote
from rsea_ros.errors import ImportMapError
from rsea_ros.records.record import FloatArray

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, KeyError, SyntaxError)


def read_npz(path: Path, wanted: Wanted) -> Table:
    """Return the requested arrays. Raises OSError and ValueError with array, shape and expectation."""
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {n.removesuffix(".npy"): archive.getinfo(n).file_size for n in archive.namelist()}
            places = {column: place_of(column) for column in wanted.columns}
            arrays: dict[str, Any] = {}
            for place in places.values():
                name = _root(place.base, sizes)
                if name not in sizes:
                    index_of(place.base, list(sizes))
                if name not in arrays:
                    with archive.open(f"{name}.npy") as file:
                        arrays[name] = _array(file, name, sizes[name])
            return column_table.finite_table({c: _numbers(c, p, arrays, sizes) for c, p in places.items()})
    except _DAMAGE as error:
        raise ValueError(f"no NPZ file that can be read ({brief(str(error))}), expected one") from None


def read_npy(path: Path, wanted: Wanted) -> Table:
    """Return columns of the one array, by number from 1 or by the name of a field."""
    with path.open("rb") as file:
        array = _array(file, path.name, path.stat().st_size)
    names = array.dtype.names or [str(n + 1) for n in range(1 if array.ndim == 1 else array.shape[-1])]
    if array.ndim > 2:
        raise ValueError(f"array of shape {array.shape}, expected a vector or a matrix")
    vectors = {}
    for column in wanted.columns:
        at = index_of(column, names)
        values = array[names[at]] if array.dtype.names else array if array.ndim == 1 else array[:, at]
        vectors[column] = _vector(column, values)
    return column_table.finite_table(vectors)


def _root(base: str, names: Any) -> str:
    """Return the array of `array.field`; an array may have a dot in its own name."""
    return base if base in names else base.rpartition(".")[0]


def _array(file: IO[bytes], name: str, size: int) -> Any:
    """Read an array whose header agrees with the file. size: its bytes in the file."""
    try:
        version = npy.read_magic(file)
        shape, _, dtype = _HEADERS[version](file)
    except KeyError:
        raise ValueError(f"array {name!r} is of version {version}, expected (1, 0) or (2, 0)") from None
    except Exception:  # NumPy evaluates it as a literal: a damaged one may bring errors of any kind
        raise ValueError(f"array {name!r} has no header that can be read; a damaged file?") from None
    held = float(np.prod(shape, dtype=float)) * dtype.itemsize
    if dtype.hasobject:
        raise ValueError(f"array {name!r} holds Python objects, expected numbers")
    if held > 8.0 * LARGEST:
        raise ValueError(f"array {name!r} is {dtype} {shape}, expected fewer than {LARGEST} numbers")
    if held > size:
        raise ValueError(f"array {name!r} is {dtype} {shape}, more than its {size} bytes; a damaged file?")
    file.seek(0)
    return npy.read_array(file, allow_pickle=False)


def _numbers(column: str, place: ElementAddress, arrays: Any, names: Any) -> FloatArray:
    root = _root(place.base, names)
    values, field = arrays[root], place.base[len(root) + 1 :]
    if field:
        index_of(field, values.dtype.names or [])
        values = values[field]
    if place.index is None:
        return _vector(column, values)
    if values.ndim != 2:
        raise ValueError(f"array {column!r} is {values.dtype} {values.shape}, expected a matrix")
    across = values.shape[0 if place.is_row else 1]
    if place.index >= across:
        raise ValueError(f"array {place.base!r} is {values.dtype} {values.shape}, no {column!r}")
    return _vector(column, values[place.index] if place.is_row else values[:, place.index])


def _vector(column: str, values: Any) -> FloatArray:
    is_vector = values.size >= 2 and values.size == max(values.shape)
    if values.dtype.kind in "Mm" and is_vector:
        return np.asarray(values.ravel().astype(f"{values.dtype.kind}8[ns]").astype(np.float64) * 1e-9)
    if values.dtype.kind not in "iufb" or not is_vector:
        more = f" or a column of the matrix, {column}[0]" if values.ndim == 2 and not is_vector else ""
        raise ValueError(
            f"array {column!r} is {values.dtype} {values.shape}, expected a vector of numbers{more}"
        )
    return np.ascontiguousarray(values.ravel(), np.float64)


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
        column_table.checked_lengths(sizes)
        return column_table.finite_table({name: _next_doubles(output, size) for name, size in sizes.items()})


def _next_doubles(output: IO[bytes], size: int) -> FloatArray:
    """Return the next doubles. They are read into place: through `read` they would lie in memory twice."""
    vector = np.empty(size, "<f8")
    if output.readinto(vector.view(np.uint8)) != 8 * size:  # type: ignore[attr-defined]
        raise ValueError("could not be read: the reader gave too few numbers; a damaged file?")
    return vector


HDF5 = b"\x89HDF\r\n\x1a\n"
_MAT_HEADER = 128
"""Bytes before the first variable."""
_ORDERS: Mapping[bytes, Literal["little", "big"]] = {b"IM": "little", b"MI": "big"}


def read_mat(path: Path, wanted: Wanted) -> Table:
    """Return the requested variables. Raises OSError and ValueError with variable, shape and expectation."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(520)
        if head.startswith(b"MATLAB 7.3") or HDF5 in (head[:8], head[512:]):
            raise ValueError(
                "MAT file of version 7.3 (HDF5), expected version 7: save(…, '-v7') in MATLAB,"
                " or docs/import.md"
            )
        file.seek(_MAT_HEADER)
        order = _ORDERS.get(head[126:128]) if head.startswith(b"MATLAB 5.0") else None
        while order and (tag := file.read(8)):
            end = file.tell() + int.from_bytes(tag[4:8], order)
            if len(tag) < 8 or end > size:
                raise ValueError(f"MAT file cut off at {size} bytes, expected {end} or more: copy it again")
            file.seek(end)
    return read_apart("MAT", LARGEST, path, wanted.columns)


def read_parquet(path: Path, wanted: Wanted) -> Table:
    """Return the requested columns. Raises OSError and ValueError with column, type and expectation."""
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            raise ValueError("no Parquet file (it does not begin with PAR1), expected one")
    if find_spec("pyarrow") is None:
        raise ValueError(
            "Parquet needs the package pyarrow, which is not installed: pip install 'rsea_ros[fleet]'"
        )
    return read_apart("Parquet", LARGEST, path, wanted.columns)


READERS: Mapping[str, Callable[[Path, Wanted], Table]] = {
    ".mat": read_mat,
    ".npz": read_npz,
    ".npy": read_npy,
    ".parquet": read_parquet,
    ".pq": read_parquet,
    ".json": json_file.read_json,
    **dict.fromkeys(json_file.LINES, json_file.read_json),
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
_KINDS: tuple[tuple[bytes | tuple[bytes, ...], str, str], ...] = (
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
    ((b"\x80\x02", b"\x80\x04", b"\x80\x05"), "a pickle, which may run any program", _AS_NPZ),
    ((b"CDF\x01", b"CDF\x02"), "a netCDF file", _AS_NPZ),
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
