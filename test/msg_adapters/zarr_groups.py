"""Zarr groups of version 2 as zarr 2.18 writes them, made by code that the reader does not share."""

from __future__ import annotations

import json
import struct
import tarfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import lz4.block
import numpy as np

BLOSC = {"id": "blosc", "cname": "lz4", "clevel": 5, "shuffle": 1, "blocksize": 0}


def blosc(content: bytes, width: int, block: int) -> bytes:
    """Return a Blosc chunk: shuffled blocks of lz4 streams, one for each byte of a number."""
    body, starts = b"", []
    count = -(-len(content) // block)
    for number in range(count):
        part = content[number * block : (number + 1) * block]
        shuffled = b"".join(part[byte::width] for byte in range(width))
        streams = width if len(part) == block and len(part) // width >= 128 else 1
        length = len(part) // streams
        starts.append(16 + 4 * count + len(body))
        for k in range(streams):
            plain = shuffled[k * length : (k + 1) * length]
            packed = lz4.block.compress(plain, store_size=False)
            packed = packed if len(packed) < len(plain) else plain
            body += struct.pack("<I", len(packed)) + packed
    head = struct.pack("<4B3I", 2, 1, 0x21, width, len(content), block, 16 + 4 * count + len(body))
    return head + struct.pack(f"<{count}I", *starts) + body


def header(values: Any, chunks: tuple[int, ...], **changed: object) -> str:
    """Return the text of an array's header."""
    return json.dumps(
        {"chunks": chunks, "compressor": BLOSC, "dimension_separator": ".", "dtype": values.dtype.str,
         "fill_value": 0.0, "filters": None, "order": "C", "shape": values.shape, "zarr_format": 2} | changed
    )  # fmt: skip


def write_group(folder: Path, arrays: Mapping[str, Any], chunk: int = 4096, block: int = 2048) -> Path:
    """Write a group of vectors and matrices with `chunk` samples a chunk; zeros fill up the last one."""
    folder.mkdir(parents=True)
    (folder / ".zgroup").write_text('{"zarr_format": 2}')
    for name, values in arrays.items():
        (folder / name).mkdir()
        (folder / name / ".zarray").write_text(header(values, (chunk, *values.shape[1:])))
        for start in range(0, len(values), chunk):
            part = values[start : start + chunk]
            padded = np.concatenate([part, np.zeros((chunk - len(part), *values.shape[1:]), values.dtype)])
            at = ".".join([str(start // chunk), *"0" * (values.ndim - 1)])
            (folder / name / at).write_bytes(blosc(padded.tobytes(), values.dtype.itemsize, block))
    return folder


def as_tar(folder: Path) -> Path:
    """Return a tar file of a group beside it."""
    file = folder.with_suffix(".tar")
    with tarfile.open(file, "w") as tar:
        tar.add(folder, arcname=folder.name)
    return file
