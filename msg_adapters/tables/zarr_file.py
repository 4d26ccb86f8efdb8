"""Arrays out of zarr groups (version 2): one number, or one row of numbers, for each sample.

Only the chunks of the requested arrays are read, and of each chunk only the part that holds samples.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.tables.blosc import unpack_blosc
from msg_adapters.tables.child import finite_table, place_of
from msg_adapters.tables.column_table import Table, check_size, index_of
from msg_adapters.tables.zarr_store import ARRAY, ArrayStore, open_zarr
from rsea_ros.documents.wording import quote
from rsea_ros.records.record import FloatArray

_LARGEST_HEADER = 1 << 16
_LARGEST_CHUNK = 1 << 31
"""Bytes that a chunk may unpack to, by the format of Blosc."""
_DTYPE = re.compile(r"[<>|](?:[iu][1248]|f[248]|b1)")
_KEYS = ("shape", "chunks", "dtype", "compressor", "filters", "order", "zarr_format")


def _copy(packed: bytes, size: int, count: int) -> bytes:
    if len(packed) != size:
        raise ValueError(f"a chunk has {len(packed)} bytes, expected {size}; a damaged file?")
    return packed[:count]


def _unpack_zlib(packed: bytes, size: int, count: int) -> bytes:
    return zlib.decompressobj().decompress(packed, count)


_CODECS: Mapping[str, Callable[[bytes, int, int], bytes]] = {
    "none": _copy,
    "blosc": unpack_blosc,
    "zlib": _unpack_zlib,
}


@dataclass(frozen=True)
class _Array:
    """An array by its header. shape, chunks: (samples,) or (samples, numbers of each)."""

    name: str
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: np.dtype[Any]
    unpack: Callable[[bytes, int, int], bytes]
    separator: str


def read_zarr(path: Path, columns: Sequence[str]) -> Table:
    """Return the requested arrays, or columns of them. Raises OSError and ValueError with the array."""
    with open_zarr(path) as store:
        if not store.arrays:
            raise ValueError("a zarr group without arrays, expected one of its subgroups")
        return finite_table({column: _column(store, column, len(columns)) for column in columns})


def _column(store: ArrayStore, column: str, columns: int) -> FloatArray:
    place = place_of(column)
    name = column if column in store.arrays else place.base
    index_of(name if name in store.arrays else column, store.arrays)
    array = _array(name, store.read(name, ARRAY))
    check_size(array.shape[0], columns)
    index = None if name == column else place.index
    is_fit = len(array.shape) == 1 if index is None else len(array.shape) == 2 and index < array.shape[1]
    if not is_fit or place.is_row or array.shape[0] < 2:
        more = f" or one of its columns, {name}[0]" if len(array.shape) == 2 else ""
        raise ValueError(f"array {column!r} has the shape {array.shape}, expected a vector of samples{more}")
    rows = range(0, array.shape[0], array.chunks[0])
    return np.concatenate([_part(store, array, row, index) for row in rows])


def _part(store: ArrayStore, array: _Array, row: int, index: int | None) -> FloatArray:
    """Return the samples of a column that lie in one chunk, from `row` on."""
    length, *across = array.chunks
    wide = across[0] if across else 1
    held = min(length, array.shape[0] - row)
    numbers = [row // length, *([] if index is None else [index // wide])]
    packed = store.read(array.name, array.separator.join(map(str, numbers)))
    size = array.dtype.itemsize * wide
    content = array.unpack(packed, length * size, held * size)
    if len(content) != held * size:
        raise ValueError(f"array {array.name!r}: a chunk of {len(content)} bytes, expected {held * size}")
    values = np.frombuffer(content, array.dtype).reshape(held, wide)
    return values[:, 0 if index is None else index % wide].astype(np.float64)


def _array(name: str, content: bytes) -> _Array:
    """Return an array by its header. Raises ValueError for a kind that is not read."""
    header = _header(name, content)
    shape, chunks = (_whole(name, key, header[key]) for key in ("shape", "chunks"))
    dtype, order = header["dtype"], header["order"]
    if not 1 <= len(shape) <= 2 or len(chunks) != len(shape) or 0 in chunks:
        held = f"shape {shape} in chunks of {chunks}"
        raise ValueError(f"array {name!r} has {held}, expected a vector or a matrix")
    if not (isinstance(dtype, str) and _DTYPE.fullmatch(dtype)):
        raise ValueError(f"array {name!r} is of type {quote(dtype)}, expected numbers")
    if header["filters"] or (order != "C" and len(shape) > 1):
        raise ValueError(f"array {name!r} has filters or the order {quote(order)}, expected none and 'C'")
    if (size := int(np.prod(chunks, dtype=object)) * np.dtype(dtype).itemsize) > _LARGEST_CHUNK:
        raise ValueError(f"array {name!r} has chunks of {size} bytes, expected at most {_LARGEST_CHUNK}")
    separator = "/" if header.get("dimension_separator") == "/" else "."
    return _Array(name, shape, chunks, np.dtype(dtype), _codec(name, header["compressor"]), separator)


def _header(name: str, content: bytes) -> Mapping[str, Any]:
    try:
        header = json.loads(content[:_LARGEST_HEADER])
    except (ValueError, RecursionError):
        header = None
    if not isinstance(header, dict) or any(key not in header for key in _KEYS) or header["zarr_format"] != 2:
        raise ValueError(f"array {name!r} has no header of zarr version 2, expected {', '.join(_KEYS)}")
    return header


def _whole(name: str, key: str, value: object) -> tuple[int, ...]:
    numbers = value if isinstance(value, list) else [None]
    if any(isinstance(n, bool) or not isinstance(n, int) or n < 0 for n in numbers):
        raise ValueError(f"array {name!r}: {key} is {quote(value)}, expected whole numbers")
    return tuple(numbers)


def _codec(name: str, compressor: object) -> Callable[[bytes, int, int], bytes]:
    kind = "none" if compressor is None else str(compressor.get("id")) if isinstance(compressor, dict) else ""
    if kind not in _CODECS:
        raise ValueError(f"array {name!r} is packed by {quote(kind)}, expected one of {', '.join(_CODECS)}")
    return _CODECS[kind]
