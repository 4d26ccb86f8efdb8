"""Damage to files of arrays by their structure: NPZ by members, headers and lengths, Parquet by columns."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bench.inputs.bytes_damage import damage_bytes

ODD_ARRAYS: tuple[Callable[[int], np.ndarray], ...] = (
    lambda n: np.arange(n, dtype="i1"),
    lambda n: np.arange(n, dtype=">f4"),
    lambda n: np.full(n, np.nan),
    lambda n: np.full(n, np.inf),
    lambda n: np.zeros((n, 0)),
    lambda n: np.zeros((n, 2, 2)),
    lambda n: np.array(["x"] * n),
    lambda n: np.array([None] * n, dtype=object),
    lambda n: np.arange(n) * 1j,
    lambda n: np.arange(n).astype("M8[ns]"),
    lambda n: np.zeros(n, dtype=[("a", "f8"), ("b", "i2")]),
    lambda n: np.float64(3.0),
    lambda n: np.arange(n - 3, dtype="f2"),
    lambda n: np.arange(2 * n)[::2],
    lambda n: np.full(n, 10**18),
)
_HEADER = (b"'<f8'", b"'|O'"), (b"'<f8'", b"'>f8'"), (b"(60,)", b"(6000000000,)"), (b"(60,)", b"(-1,)")
_HEADER += (b"False", b"True "), (b"descr", b"DESCR"), (b"(60,)", b"(7, 9)"), (b"\x01\x00v", b"\x03\x00v")


def damaged_npz(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an NPZ file with members changed, renamed, doubled or dropped, or other bytes in them."""
    if rng.random() < 0.3:
        return damage_bytes(rng, data, other)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:
        return damage_bytes(rng, data, other)
    for _ in range(rng.choice((1, 1, 3))):
        name = rng.choice([*members] or ["t.npy"])
        _member(rng, members, name)
    buffer = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, held in members.items():
            archive.writestr(name, held)
    return buffer.getvalue()


def _member(rng: random.Random, members: dict[str, bytes], name: str) -> None:
    """Change one member."""
    held = members.get(name, b"")
    kind = rng.randrange(6)
    if kind == 0:
        members.pop(name, None)
    elif kind == 1:
        members[rng.choice(("x.npy", "t", "../t.npy", name + ".npy", "ä.npy"))] = members.pop(name, b"")
    elif kind == 2:
        array = rng.choice(ODD_ARRAYS)(60)
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=True)
        members[name] = buffer.getvalue()
    elif kind == 3:
        old, new = rng.choice(_HEADER)
        members[name] = held.replace(old, new, 1)
    elif kind == 4:
        members[name] = held[: rng.randrange(len(held) + 1)]
    else:
        members[name] = damage_bytes(rng, held, held) if held else b""


ODD_COLUMNS: tuple[Callable[[int], pa.Array], ...] = (
    lambda n: pa.array(["x"] * n),
    lambda n: pa.array([None] * n),
    lambda n: pa.array([True] * n),
    lambda n: pa.array([None, 1.0] * (n // 2)),
    lambda n: pa.array([float("inf")] * n),
    lambda n: pa.array([[1.0]] * n),
    lambda n: pa.array([[]] * n, pa.list_(pa.float32())),
    lambda n: pa.array([None if k % 7 else [1.0, 2.0, 3.0] for k in range(n)]),
    lambda n: pa.array([{"a": 1.0}] * n),
    lambda n: pa.array(range(n), pa.timestamp("us", "UTC")),
    lambda n: pa.array(range(n), pa.duration("ms")),
    lambda n: pa.array(range(n), pa.decimal128(12, 3)),
    lambda n: pa.array(range(n), pa.uint64()),
    lambda n: pa.array(range(n), pa.date32()),
    lambda n: pa.array(["a", "b"] * (n // 2)).dictionary_encode(),
    lambda n: pa.array([b"x"] * n),
    lambda n: pa.array([1.5] * n, pa.float16()) if hasattr(pa, "float16") else pa.array([1.5] * n),
)


def damaged_parquet(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a Parquet file with columns changed, renamed, doubled or dropped, or other bytes in it."""
    if rng.random() < 0.5:
        return damage_bytes(rng, data, other)
    try:
        table = pq.read_table(io.BytesIO(data), use_threads=False)
        columns = [(name, table.column(name)) for name in table.column_names]
    except Exception:
        return damage_bytes(rng, data, other)
    for _ in range(rng.choice((1, 1, 3))):
        at, kind = rng.randrange(len(columns)), rng.randrange(5)
        name = columns[at][0]
        if kind < 2:
            columns[at] = name, rng.choice(ODD_COLUMNS)(len(table))
        elif kind == 2 and len(columns) > 1:
            columns.pop(at)
        elif kind == 3:
            columns[at] = rng.choice(("x", "", "a.b", name.upper(), "ä")), columns[at][1]
        else:
            columns.append(columns[at])
    rows = min(rng.choice((60, 60, 1, 0)), *(len(column) for _, column in columns))
    changed = pa.table([column.slice(0, rows) for _, column in columns], names=[name for name, _ in columns])
    buffer = io.BytesIO()
    codec = rng.choice(("snappy", "none", "zstd", "gzip", "brotli"))
    pq.write_table(changed, buffer, row_group_size=rng.choice((7, 100)), compression=codec)
    return buffer.getvalue()
