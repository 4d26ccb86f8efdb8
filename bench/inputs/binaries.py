"""Damage to binary files by their structure: bags (MCAP, sqlite), their messages, tables (NPZ, Parquet)."""

from __future__ import annotations

import io
import random
import sqlite3
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bench.inputs.bytes_damage import ODD_DOUBLES, ODD_NUMBERS, damage_bytes

MAGIC = b"\x89MCAP0\r\n"
CHUNK, MESSAGE = 0x06, 0x05
CHUNK_HEAD = struct.Struct("<QQQIIQ")
"""Of a chunk without compression: start, end, size, checksum, length of the compression's name, size."""
Records = list[tuple[int, bytes]]


def records_of(data: bytes) -> Records:
    """Return the records of an MCAP file or chunk, none where one is not whole."""
    at, found = 0, []
    while at < len(data):
        if at + 9 > len(data):
            return []
        opcode, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            return []
        found.append((opcode, data[at + 9 : at + 9 + size]))
        at += 9 + size
    return found


def join_records(records: Records) -> bytes:
    """Return records as bytes, with their right lengths."""
    return b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)


def damaged_mcap(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an MCAP file damaged in its bytes, among its records, inside a chunk, or in its messages."""
    records = records_of(data[len(MAGIC) : -len(MAGIC)]) if data.startswith(MAGIC) else []
    if not records or rng.random() < 0.25:
        return damage_bytes(rng, data, other)
    for _ in range(rng.choice((1, 1, 2))):
        at, kind = rng.randrange(len(records)), rng.randrange(8)
        chunks = [k for k, (opcode, _) in enumerate(records) if opcode == CHUNK]
        if kind >= 4 and chunks:
            at = rng.choice(chunks)
            records[at] = (CHUNK, _chunk(rng, records[at][1]))
        elif kind == 0 and len(records) > 1:
            records.pop(at)
        elif kind == 1:
            records.insert(rng.randrange(len(records)), records[at])
        elif kind == 2:
            records[at] = (rng.choice((0, 1, 3, 4, 5, 6, 0x0F, 0x0B, 0x42, 0xFF)), records[at][1])
        else:
            records[at] = (records[at][0], damage_bytes(rng, records[at][1]))
    return MAGIC + join_records(records) + rng.choice((MAGIC, MAGIC, MAGIC, b""))


def _chunk(rng: random.Random, body: bytes) -> bytes:
    """Return a chunk with other messages, its sizes and its checksum made right or left wrong."""
    if len(body) < CHUNK_HEAD.size:
        return body
    start, stop, _, _, name, _ = CHUNK_HEAD.unpack_from(body)
    inner = body[CHUNK_HEAD.size :]
    records = records_of(inner) if name == 0 else []
    messages = [k for k, (opcode, raw) in enumerate(records) if opcode == MESSAGE and len(raw) > 22]
    for k in rng.sample(messages, min(len(messages), rng.choice((1, 3, 100)))):
        raw = records[k][1]
        records[k] = (MESSAGE, raw[:22] + damaged_message(rng, raw[22:]))
    inner = join_records(records) if messages else damage_bytes(rng, inner)
    sizes = [rng.choice((len(inner), len(inner), len(inner), rng.choice(ODD_NUMBERS))) for _ in range(2)]
    checksum = rng.choice((zlib.crc32(inner), zlib.crc32(inner), 0, 1))
    return CHUNK_HEAD.pack(start, stop, sizes[0], checksum, 0, sizes[1]) + inner


def damaged_message(rng: random.Random, raw: bytes) -> bytes:
    """Return a serialised message with odd lengths, stamps, values, header or end."""
    kind = rng.randrange(6)
    at = 4 * rng.randrange(1, max(2, len(raw) // 4))
    if kind == 0:
        return damage_bytes(rng, raw)
    if kind == 1:
        return rng.choice((b"\x00\x00", b"\x00\x02", b"\x00\x03", b"\x00\x0a", b"\xff\xff")) + raw[2:]
    if kind == 2:
        return raw[:at] + struct.pack("<I", rng.choice(ODD_NUMBERS) & 0xFFFFFFFF) + raw[at + 4 :]
    if kind == 3:
        return raw[:at] + struct.pack("<d", rng.choice(ODD_DOUBLES)) + raw[at + 8 :]
    if kind == 4:
        seconds, rest = rng.choice((-1, 0, 2**31 - 1, -(2**31))), rng.choice((0, 10**9, 2**32 - 1))
        return raw[:4] + struct.pack("<iI", seconds, rest) + raw[12:]
    return raw + rng.randbytes(rng.choice((1, 4, 1000)))


_VALUES = (
    "NULL", "''", "'x'", "0", "-1", "9223372036854775807", "-9223372036854775808", "1e308", "x'00'",
    "zeroblob(8)", "zeroblob(50000000)", "randomblob(64)", "'/rsea/ft'", "char(0)", "char(27)", "x'fffe'",
    "'sensor_msgs/msg/JointState'",
)  # fmt: skip
_COLUMNS = {
    "messages": ("topic_id", "timestamp", "data"),
    "topics": ("name", "type", "serialization_format", "id"),
    "schema": ("schema_version",),
}
ENDLESS = "AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x AS id, x AS timestamp"
STEPS = 5_000_000
"""Steps of a statement that damages a database; one with more does not end."""
LARGEST = 50_000_000
"""Bytes of a damaged database: copies of copies would fill the memory of the process that makes them."""


def damaged_sqlite(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a database damaged in its bytes or by statements that a program could have run on it."""
    if rng.random() < 0.4:
        return damage_bytes(rng, data, other)
    return _changed_by(data, *(_statement(rng) for _ in range(rng.choice((1, 1, 2, 4)))))


def bag_of_views(data: bytes) -> bytes:
    """Return a database whose messages are an endless view, made by the bytes of another."""
    view = f"CREATE VIEW messages {ENDLESS}, 1 AS topic_id, zeroblob(80) AS data FROM c"
    return _changed_by(data, "ALTER TABLE messages RENAME TO old", view)


def _changed_by(data: bytes, *statements: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.db3"
        path.write_bytes(data)
        database = sqlite3.connect(path)
        database.text_factory = bytes
        database.set_progress_handler(lambda: True, STEPS)  # ends what reads a view without end
        for statement in (f"PRAGMA max_page_count = {LARGEST // 4096}", *statements, "COMMIT"):
            with suppress(sqlite3.Error):
                database.execute(statement)
        database.close()
        return path.read_bytes()


def _statement(rng: random.Random) -> str:
    table = rng.choice(("messages", "messages", "topics", "topics", "schema"))
    column = rng.choice(_COLUMNS[table])
    some = rng.choice(("", f" WHERE rowid % {rng.choice((2, 7, 50))} = 0", " WHERE rowid = 3"))
    return rng.choice((
        f"UPDATE {table} SET {column} = {rng.choice(_VALUES)}{some}",
        f"UPDATE {table} SET {column} = {rng.choice(_VALUES)}{some}",
        f"UPDATE messages SET data = substr(data, 1, {rng.choice((0, 1, 4, 11, 40, 80))}){some}",
        f"UPDATE messages SET data = CAST(data || x'00' AS BLOB){some}",
        f"DELETE FROM {table}{some}",
        f"DROP TABLE {table}",
        f"ALTER TABLE {table} RENAME TO {table}2",
        f"ALTER TABLE {table} RENAME COLUMN {column} TO other",
        f"INSERT INTO {table} SELECT * FROM {table}",
        "INSERT INTO topics SELECT id + 100, name, type, serialization_format, offered_qos_profiles, "
        "type_description_hash FROM topics",
        "UPDATE messages SET topic_id = topic_id + 100",
        f"CREATE VIEW {rng.choice(('messages', 'topics', 'x'))} {ENDLESS}, x AS topic_id, x AS data FROM c",
        "PRAGMA user_version = 99",
    ))  # fmt: skip


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
    lambda n: np.array(3.0),
    lambda n: np.arange(n - 3, dtype="f2"),
    lambda n: np.full(n, 10**18),
)
_HEADER = (
    (b"'<f8'", b"'|O'"), (b"'<f8'", b"'>f8'"), (b"(60,)", b"(6000000000,)"), (b"(60,)", b"(-1,)"),
    (b"False", b"True "), (b"descr", b"DESCR"), (b"(60,)", b"(7, 9)"), (b"\x01\x00v", b"\x03\x00v"),
)  # fmt: skip


def damaged_npz(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an NPZ file with a member changed, renamed or dropped, or other bytes in it."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:
        members = {}
    if not members or rng.random() < 0.3:
        return damage_bytes(rng, data, other)
    name, kind = rng.choice([*members]), rng.randrange(6)
    held = members.pop(name)
    if kind == 1:
        members[rng.choice(("x.npy", "t", "../t.npy", name + ".npy", "ä.npy"))] = held
    elif kind == 2:
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, rng.choice(ODD_ARRAYS)(60), allow_pickle=True)
        members[name] = buffer.getvalue()
    elif kind == 3:
        members[name] = held.replace(*rng.choice(_HEADER), 1)
    elif kind > 3:
        members[name] = held[: rng.randrange(len(held) + 1)] if kind == 4 else damage_bytes(rng, held, held)
    buffer = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, held in members.items():
            archive.writestr(name, held)
    return buffer.getvalue()


ODD_COLUMNS: tuple[Callable[[int], pa.Array], ...] = (
    lambda n: pa.array(["x"] * n),
    lambda n: pa.array([None] * n),
    lambda n: pa.array([True] * n),
    lambda n: pa.array([None if k % 2 else 1.0 for k in range(n)]),
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
    lambda n: pa.array(["a"] * n).dictionary_encode(),
    lambda n: pa.array([b"x"] * n),
)


def damaged_parquet(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a Parquet file with a column changed, renamed, doubled or dropped, or other bytes in it."""
    try:
        table = pq.read_table(io.BytesIO(data), use_threads=False)
    except Exception:
        return damage_bytes(rng, data, other)
    if rng.random() < 0.5 or not table.num_columns:
        return damage_bytes(rng, data, other)
    at, kind = rng.randrange(table.num_columns), rng.randrange(5)
    name, column = table.column_names[at], table.column(at)
    if kind < 2:
        table = table.set_column(at, name, rng.choice(ODD_COLUMNS)(len(table)))
    elif kind == 2:
        table = table.remove_column(at)
    elif kind == 3:
        table = table.set_column(at, rng.choice(("x", "", "a.b", name.upper(), "ä")), column)
    else:
        table = table.append_column(name, column)
    buffer = io.BytesIO()
    codec = rng.choice(("snappy", "none", "zstd", "gzip", "brotli"))
    rows = table.slice(0, rng.choice((60, 60, 1, 0)))
    pq.write_table(rows, buffer, row_group_size=rng.choice((7, 100)), compression=codec)
    return buffer.getvalue()
