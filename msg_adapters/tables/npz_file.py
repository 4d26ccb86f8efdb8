"""Arrays out of NPZ and NPY files: no pickles, and the size of an array is known before it is read."""

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from msg_adapters.tables.child import ElementAddress, finite_table, place_of
from msg_adapters.tables.column_table import LARGEST, Table, Wanted, index_of
from rsea_ros.documents.wording import brief
from rsea_ros.records.record import FloatArray

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, KeyError, SyntaxError)


def read_npz(path: Path, wanted: Wanted) -> Table:
    """Return the requested arrays. Raises OSError and ValueError with array, shape and expectation."""
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {n.removesuffix(".npy"): archive.getinfo(n).file_size for n in archive.namelist()}
            places = {column: _check_address(place_of(column), list(sizes)) for column in wanted.columns}
            arrays: dict[str, Any] = {}
            for place in places.values():
                name = _root(place.base, sizes)
                if name not in arrays:
                    with archive.open(f"{name}.npy") as file:
                        arrays[name] = _array(file, name, sizes[name])
            return finite_table({c: _numbers(c, p, arrays, sizes) for c, p in places.items()})
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
    return finite_table(vectors)


def _check_address(place: ElementAddress, names: Sequence[str]) -> ElementAddress:
    """Return a place whose array is in the file. Raises ValueError for another."""
    if _root(place.base, names) not in names:
        index_of(place.base, names)
    return place


def _root(base: str, names: Any) -> str:
    """Return the array of `array.field`; an array may have a dot in its own name."""
    return base if base in names else base.rpartition(".")[0]


def _array(file: IO[bytes], name: str, size: int) -> Any:
    """Read an array whose header agrees with the file. size: its bytes in the file."""
    shape, dtype = _header(file, name)
    held = float(np.prod(shape, dtype=float)) * dtype.itemsize
    if dtype.hasobject:
        raise ValueError(f"array {name!r} holds Python objects, expected numbers")
    if held > 8.0 * LARGEST:
        raise ValueError(f"array {name!r} is {dtype} {shape}, expected fewer than {LARGEST} numbers")
    if held > size:
        raise ValueError(f"array {name!r} is {dtype} {shape}, more than its {size} bytes; a damaged file?")
    with _rewound(file) as again:
        return npy.read_array(again, allow_pickle=False)


def _header(file: IO[bytes], name: str) -> tuple[Any, Any]:
    try:
        version = npy.read_magic(file)
        shape, _, dtype = _HEADERS[version](file)
    except KeyError:
        raise ValueError(f"array {name!r} is of version {version}, expected (1, 0) or (2, 0)") from None
    except Exception:  # NumPy evaluates it as a literal: a damaged one may bring errors of any kind
        raise ValueError(f"array {name!r} has no header that can be read; a damaged file?") from None
    return shape, dtype


@contextmanager
def _rewound(file: IO[bytes]) -> Iterator[IO[bytes]]:
    file.seek(0)
    yield file


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
