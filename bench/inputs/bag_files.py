"""Damage to bags: MCAP by its records, sqlite by its statements, messages by their CDR."""

from __future__ import annotations

import random
import sqlite3
import struct
import tempfile
import zlib
from contextlib import suppress
from pathlib import Path

from bench.inputs.bytes_damage import ODD_DOUBLES, ODD_NUMBERS, damage_bytes

MAGIC = b"\x89MCAP0\r\n"
CHUNK, MESSAGE = 0x06, 0x05
CHUNK_HEAD = struct.Struct("<QQQI")
Records = list[tuple[int, bytes]]


def records_of(data: bytes) -> Records | None:
    """Return the records of an MCAP file or chunk, None for one that is not whole."""
    at, ends = 0, []
    while at < len(data):
        if at + 9 > len(data):
            return None
        opcode, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            return None
        ends.append((opcode, data[at + 9 : at + 9 + size]))
        at += 9 + size
    return ends


def join_records(records: Records) -> bytes:
    """Return records as bytes, with their right lengths."""
    return b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)


def damaged_mcap(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an MCAP file damaged in its bytes, among its records, inside a chunk, or in its messages."""
    records = records_of(data[len(MAGIC) : -len(MAGIC)]) if data.startswith(MAGIC) else None
    if records is None or rng.random() < 0.25:
        return damage_bytes(rng, data, other)
    return MAGIC + join_records(_records(rng, records)) + rng.choice((MAGIC, MAGIC, MAGIC, b""))


def _records(rng: random.Random, records: Records) -> Records:
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(records))
        kind = rng.randrange(8)
        chunks = [k for k, (opcode, _) in enumerate(records) if opcode == CHUNK]
        if kind >= 4 and chunks:
            at = rng.choice(chunks)
            records[at] = (CHUNK, _chunk(rng, records[at][1]))
        elif kind == 0:
            records.pop(at)
        elif kind == 1:
            records.insert(rng.randrange(len(records)), records[at])
        elif kind == 2:
            records[at] = (rng.choice((0, 1, 3, 4, 5, 6, 0x0F, 0x0B, 0x42, 0xFF)), records[at][1])
        else:
            records[at] = (records[at][0], damage_bytes(rng, records[at][1]))
        if not records:
            return [(1, b"")]
    return records


def _chunk(rng: random.Random, body: bytes) -> bytes:
    """Return a chunk with other content, its checksum made right or left wrong, compressed or so called."""
    if len(body) < CHUNK_HEAD.size + 4:
        return body
    start, stop, *_ = CHUNK_HEAD.unpack_from(body)
    text = struct.unpack_from("<I", body, CHUNK_HEAD.size)[0]
    inner = body[CHUNK_HEAD.size + 4 + text + 8 :]
    inside = records_of(inner) if text == 0 else None
    if inside:
        inner = _inside(rng, inside)
    elif inner:
        inner = damage_bytes(rng, inner)
    named = rng.choice((b"", b"", b"", b"", b"zstd", b"lz4", b"gzip", b"\xff", b"x" * 1000))
    packed = _pack(rng, named, inner)
    declared = rng.choice((len(inner), len(inner), len(inner), rng.choice(ODD_NUMBERS)))
    checksum = rng.choice((zlib.crc32(inner), zlib.crc32(inner), 0, 1))
    head = CHUNK_HEAD.pack(start, stop, declared, checksum) + struct.pack("<I", len(named)) + named
    return head + struct.pack("<Q", rng.choice((len(packed), len(packed), rng.choice(ODD_NUMBERS)))) + packed


def _inside(rng: random.Random, records: Records) -> bytes:
    kind = rng.randrange(6)
    messages = [k for k, (opcode, body) in enumerate(records) if opcode == MESSAGE and len(body) > 22]
    if kind == 0:
        return join_records(_nest(records, rng.choice((1, 2, 5, 60, 400))))
    if kind in (1, 2) or not messages:
        return join_records([r if rng.random() > 0.02 else (r[0], damage_bytes(rng, r[1])) for r in records])
    for k in rng.sample(messages, min(len(messages), rng.choice((1, 3, 100)))):
        body = records[k][1]
        records[k] = (MESSAGE, body[:22] + damaged_message(rng, body[22:]))
    return join_records(records)


def _nest(records: Records, depth: int) -> Records:
    """Return chunks in chunks, which the format forbids."""
    for _ in range(depth):
        inner = join_records(records)
        head = CHUNK_HEAD.pack(0, 0, len(inner), 0) + struct.pack("<IQ", 0, len(inner))
        records = [(CHUNK, head + inner)]
    return records


def _pack(rng: random.Random, named: bytes, inner: bytes) -> bytes:
    from lz4.frame import compress as lz4

    try:
        from compression import zstd
    except ImportError:
        from backports import zstd

    if rng.random() < 0.05 and named in (b"zstd", b"lz4"):
        inner = bytes(300_000_000)  # a small file that would take all memory
    if named == b"zstd":
        inner = zstd.compress(inner)
    elif named == b"lz4":
        inner = lz4(inner)
    return damage_bytes(rng, inner) if inner and rng.random() < 0.3 else inner


def damaged_message(rng: random.Random, raw: bytes, other: bytes = b"") -> bytes:
    """Return a serialised message with odd lengths, stamps, values, header or end."""
    kind = rng.randrange(6)
    if kind == 0:
        return damage_bytes(rng, raw)
    if kind == 1:
        return rng.choice((b"\x00\x00", b"\x00\x02", b"\x00\x03", b"\x00\x0a", b"\xff\xff")) + raw[2:]
    at = 4 * rng.randrange(1, max(2, len(raw) // 4))
    if kind == 2:
        return raw[:at] + struct.pack("<I", rng.choice(ODD_NUMBERS) & 0xFFFFFFFF) + raw[at + 4 :]
    if kind == 3:
        return raw[:at] + struct.pack("<d", rng.choice(ODD_DOUBLES)) + raw[at + 8 :]
    if kind == 4:
        return (
            raw[:4]
            + struct.pack("<iI", rng.choice((-1, 0, 2**31 - 1, -(2**31))), rng.choice((0, 10**9, 2**32 - 1)))
            + raw[12:]
        )
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


STEPS = 5_000_000
"""Steps of a statement that damages a database; one with more does not end."""
LARGEST = 50_000_000
"""Bytes of a damaged database: copies of copies would fill the memory of the process that makes them."""


def damaged_sqlite(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a database damaged in its bytes or by statements that a program could have run on it."""
    if rng.random() < 0.4:
        return damage_bytes(rng, data, other)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.db3"
        path.write_bytes(data)
        database = sqlite3.connect(path)
        database.text_factory = bytes
        with suppress(sqlite3.Error):
            database.execute(f"PRAGMA max_page_count = {LARGEST // 4096}")
        database.set_progress_handler(lambda: True, STEPS)  # ends what reads a view without end
        for _ in range(rng.choice((1, 1, 2, 4))):
            try:
                database.execute(_statement(rng))
            except sqlite3.Error:
                continue
        with suppress(sqlite3.Error):
            database.commit()
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
        f"CREATE TABLE IF NOT EXISTS {table}2 AS SELECT * FROM {table}",
        f"INSERT INTO {table} SELECT * FROM {table}",
        "INSERT INTO topics SELECT id + 100, name, type, serialization_format, offered_qos_profiles, "
        "type_description_hash FROM topics",
        "UPDATE messages SET topic_id = topic_id + 100",
        f"CREATE VIEW {rng.choice(('messages', 'topics', 'x'))} AS WITH RECURSIVE c(x) AS "
        "(SELECT 1 UNION ALL SELECT x + 1 FROM c) "
        "SELECT x AS id, x AS topic_id, x AS timestamp, x AS data FROM c",
        "PRAGMA user_version = 99",
    ))  # fmt: skip


def bag_of_views(data: bytes) -> bytes:
    """Return a database whose tables are endless views, made by the bytes of another."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.db3"
        path.write_bytes(data)
        database = sqlite3.connect(path)
        database.executescript(
            "ALTER TABLE messages RENAME TO old; CREATE VIEW messages AS WITH RECURSIVE c(x) AS "
            "(SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x AS id, 1 AS topic_id, x AS timestamp, "
            "zeroblob(80) AS data FROM c"
        )
        database.close()
        return path.read_bytes()
