"""Arrays of 64-bit floats from an HDF5 file of the old format, in one piece, as the benchmarks have them.

The lock has no HDF5 library. Source: HDF5 File Format Specification 3.0, sections II.A, III.A to III.D, IV.A.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from rsea_ros.records.record import FloatArray

_ROOT, _ENTRY, _LAYOUT, _CONTINUED, _GROUP_CACHED = 56, 40, 0x8, 0x10, 1


def arrays(path: Path) -> dict[str, FloatArray]:
    """Return every array of a file by its name, such as `multisine/u`, flat.

    Raises ValueError for another format.
    """
    data = path.read_bytes()
    if data[:9] != b"\x89HDF\r\n\x1a\n\x00":
        raise ValueError(f"{path}: begins with {data[:9]!r}, expected an HDF5 file of format 0")
    return {
        name.strip("/"): np.frombuffer(data, "<f8", size // 8, at)
        for name, (at, size) in _walk(data, _ROOT, "").items()
    }


def _walk(data: bytes, entry: int, name: str) -> dict[str, tuple[int, int]]:
    """Return where the arrays under a symbol table entry lie and how long they are, bytes, by name."""
    header, cached = struct.unpack_from("<QI", data, entry + 8)
    if cached != _GROUP_CACHED:
        return {name: _layout(data, header)}
    tree, heap = struct.unpack_from("<QQ", data, entry + 24)
    names = struct.unpack_from("<Q", data, heap + 24)[0]
    members: dict[str, tuple[int, int]] = {}
    for node in _leaves(data, tree):
        for i in range(struct.unpack_from("<H", data, node + 6)[0]):
            child = node + 8 + i * _ENTRY
            start = names + struct.unpack_from("<Q", data, child)[0]
            word = data[start : data.index(b"\0", start)].decode()
            members |= _walk(data, child, f"{name}/{word}")
    return members


def _leaves(data: bytes, tree: int) -> list[int]:
    """Return the addresses of the symbol nodes under a tree."""
    level, count = struct.unpack_from("<BH", data, tree + 5)
    children = [struct.unpack_from("<Q", data, tree + 32 + 16 * i)[0] for i in range(count)]
    return children if level == 0 else [leaf for child in children for leaf in _leaves(data, child)]


def _layout(data: bytes, header: int) -> tuple[int, int]:
    """Return address and length of an array that is stored in one piece."""
    left, blocks = struct.unpack_from("<H", data, header + 2)[0], [header + 16]
    while left and blocks:
        at = blocks.pop(0)
        while left:
            kind, size = struct.unpack_from("<HH", data, at)
            left -= 1
            if kind == _LAYOUT and data[at + 8 : at + 10] == b"\x03\x01":
                return struct.unpack_from("<QQ", data, at + 10)
            if kind == _CONTINUED:
                blocks.append(struct.unpack_from("<Q", data, at + 8)[0])
                break
            at += 8 + size
    raise ValueError(f"object at {header}: no array in one piece, expected one")
