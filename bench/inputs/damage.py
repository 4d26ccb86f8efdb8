"""Damage to files: bytes without regard to the format, and parts of each format that is read.

A damaged file of a format is, in a share of the draws, one with other bytes; else its parts are replaced,
dropped, doubled and renamed: records of MCAP, statements on a database, nodes of YAML
and JSON, lines and cells of text, members of NPZ, columns of Parquet.
"""

import copy
import gzip
import io
import json
import random
import sqlite3
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

Damage = Callable[[random.Random, bytes, bytes], bytes]
"""Draws, a well-formed file and another one: a damaged file."""
ODD_NUMBERS = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)
ODD_DOUBLES = (
    float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 1e-300, 0.0, -0.0, 1e30, 1e31,
)  # fmt: skip


def in_bytes(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return bytes with one or a few places changed. other: bytes that may be spliced in."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        data = _damage_once(rng, data, other or data) if data else rng.randbytes(8)
    return data


def _damage_once(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Return bytes with a bit, a byte or a number changed, cut off, or with a part left out, put in, doubled,
    blanked or of another file."""
    at, size = rng.randrange(len(data)), rng.choice((1, 4, 16, 256, 4096))
    head, tail, put = data[:at], data[at:], _odd_number(rng)
    byte, blank = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))), rng.choice((b"\0", b"\xff"))
    changed = (
        (2, bytes((tail[0] ^ 1 << rng.randrange(8),)) + tail[1:]),
        (1, bytes((byte,)) + tail[1:]),
        (3, put + tail[len(put) :]),
        (1, b""),
        (1, tail[rng.choice((1, 2, 4, 8, 64, 512)) :]),
        (1, rng.randbytes(rng.choice((1, 2, 4, 8, 64))) + tail),
        (1, tail[:size] * rng.choice((2, 2, 4, 51)) + tail[size:]),
        (1, blank * min(size, len(tail)) + tail[size:]),
        (1, other[rng.randrange(len(other)) :]),
    )
    shares, parts = zip(*changed, strict=True)
    return head + bytes(rng.choices(parts, shares)[0])


def _odd_number(rng: random.Random) -> bytes:
    """Return an odd whole number or double, as lengths, counts, stamps and values are."""
    width, order = rng.choice((2, 4, 4, 8)), rng.choice("<<<>")
    if width == 8 and rng.random() < 0.5:
        return struct.pack(f"{order}d", rng.choice(ODD_DOUBLES))
    code = {2: "H", 4: "I", 8: "Q"}[width]
    return struct.pack(f"{order}{code}", rng.choice(ODD_NUMBERS) & (1 << 8 * width) - 1)


Parts = list[tuple[Any, Any]]
"""The parts of a file: key (opcode, name) and content."""


def in_parts(rng: random.Random, parts: Parts, odd: Sequence[Any], change: Callable[[Any], Any]) -> Parts:
    """Return parts of which one or two are dropped, doubled, renamed, or changed.

    odd: keys that a part may get. change: returns another content.
    """
    parts = list(parts)
    for _ in range(rng.choice((1, 1, 2)) if parts else 0):
        at, kind = rng.randrange(len(parts)), rng.randrange(8)
        if kind == 0 and len(parts) > 1:
            parts.pop(at)
        elif kind == 1:
            parts.insert(rng.randrange(len(parts)), parts[at])
        elif kind == 2:
            parts[at] = (rng.choice(odd), parts[at][1])
        else:
            parts[at] = (parts[at][0], change(parts[at][1]))
    return parts


MAGIC = b"\x89MCAP0\r\n"


def _records_of(data: bytes) -> Parts:
    """Return the records of an MCAP file, opcode and content; none where one is not whole."""
    at, found = 0, []
    while at + 9 <= len(data):
        opcode, size = struct.unpack_from("<BQ", data, at)
        found.append((opcode, data[at + 9 : at + 9 + size]))
        at += 9 + size
    return found if at == len(data) else []


def in_mcap(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an MCAP file damaged in its bytes or among its records.

    test/msg_adapters/test_damaged.py damages messages in chunks whose checksum fits.
    """
    records = _records_of(data[len(MAGIC) : -len(MAGIC)]) if data.startswith(MAGIC) else []
    if not records or rng.random() < 0.25:
        return in_bytes(rng, data, other)
    odd = (0, 1, 3, 4, 5, 6, 0x0F, 0x0B, 0x42, 0xFF)
    records = in_parts(rng, records, odd, partial(in_bytes, rng))
    whole = b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)
    return MAGIC + whole + rng.choice((MAGIC, MAGIC, MAGIC, b""))


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
STEPS, LARGEST = 5_000_000, 50_000_000
"""Steps of a statement that damages a database, more do not end; bytes of a damaged one: copies of copies
would fill the memory of the process that makes them."""


def in_sqlite(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a database damaged in its bytes or by statements that a program could have run on it."""
    if rng.random() < 0.4:
        return in_bytes(rng, data, other)
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
    update = f"UPDATE {table} SET {column} = {rng.choice(_VALUES)}{some}"
    return rng.choice((
        update, update,
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


def in_npz(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an NPZ file with a member changed, renamed or dropped, or other bytes in it."""
    members: Parts = []
    with suppress(Exception), zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    if not members or rng.random() < 0.3:
        return in_bytes(rng, data, other)

    def change(held: bytes) -> bytes:
        kind, buffer = rng.randrange(3), io.BytesIO()
        if kind == 0:
            np.lib.format.write_array(buffer, rng.choice(ODD_ARRAYS)(60), allow_pickle=True)
        return (buffer.getvalue(), held.replace(*rng.choice(_HEADER), 1), in_bytes(rng, held))[kind]

    buffer = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    odd = ("x.npy", "t", "../t.npy", "t.npy.npy", "ä.npy")
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, held in dict(in_parts(rng, members, odd, change)).items():
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


def in_parquet(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a Parquet file with a column changed, renamed, doubled or dropped, or other bytes in it."""
    try:
        table = pq.read_table(io.BytesIO(data), use_threads=False)
    except Exception:
        return in_bytes(rng, data, other)
    if rng.random() < 0.5 or not table.num_columns:
        return in_bytes(rng, data, other)
    columns = list(zip(table.column_names, table.columns, strict=True))
    odd = ("x", "", "a.b", "PHI", "ä")
    columns = in_parts(rng, columns, odd, lambda column: rng.choice(ODD_COLUMNS)(len(column)))
    table = pa.table([column for _, column in columns], names=[name for name, _ in columns])
    buffer = io.BytesIO()
    codec = rng.choice(("snappy", "none", "zstd", "gzip", "brotli"))
    rows = table.slice(0, rng.choice((60, 60, 1, 0)))
    pq.write_table(rows, buffer, row_group_size=rng.choice((7, 100)), compression=codec)
    return buffer.getvalue()


ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 10**30, 10**400, 0.0, -0.0, 1e308, -1e308, 5e-324, 1e-300, 1e30,
    float("nan"), float("inf"), -float("inf"), "", " ", "x", "nan", "1e5", "0x10", "1:30", "-", "null", "~",
    "a" * 100_000, "\u0000", "\x1b[2J", "ä", "\ud7ff", "2026-01-01", "[1]", "{", "*a", "&a", "!!python/none",
    "%",    [], {}, [None], [1, 2], [[]], {"a": 1}, {"": ""}, {1: 2}, [float("nan")], list(range(1000)),
)  # fmt: skip
ODD_LINES = (
    "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]", "? [a]\n: b", "<<: {a: 1}",
    "!!binary |\n  x",
    "!!python/object/apply:os.getcwd []", "--- {}\n---", "\t- x", "x: 2026-13-45", "x: 0o777", "x: .nan",
    "x: 1_000", "x: 190:20:30", "x: " + "[" * 2000, "{" * 500, "- " * 500, "%YAML 3.0", "\ufeffx: 1",
    "x: 'open",
)  # fmt: skip
ODD_CELLS = (
    "", " ", "nan", "inf", "-inf", "1e999", "1e308", "NA", "x", "1,5", "0x1F", "1 2", '"', '"1"', "\x00", "ä",
    "1e", "--1", "+1", "1_0", "٣", "9" * 400, "#1", "\ufeff1", "1;2", "1\t", "\r", "=1+1",
    "1" + " " * 10_000,
)  # fmt: skip


def change_nodes(rng: random.Random, document: Any, odd: Sequence[Any] = ODD_VALUES) -> Any:
    """Return a document of dictionaries and lists with some nodes replaced, removed, renamed or doubled.

    odd: values that a node may get; those of a document may also be nested and scaled.
    """
    document = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 2, 4))):
        places = list(_places(document))
        if not places:
            return rng.choice(odd)
        _change_node(rng, *rng.choice(places), odd)
    return document


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys:
        yield node, key
        yield from _places(node[key])


def _change_node(rng: random.Random, parent: Any, key: Any, odd: Sequence[Any]) -> None:
    held, kind = parent[key], rng.randrange(9)
    if kind < 3 and odd is ODD_VALUES and isinstance(held, int | float) and not isinstance(held, bool):
        parent[key] = float(held) * rng.choice((-1.0, 0.0, 1e-300, 1e-12, 1e-3, 1e3, 1e12, 1e300))
    elif kind < 5:
        parent[key] = copy.deepcopy(rng.choice(odd))
    elif kind == 5:
        del parent[key]
    elif kind == 6 and odd is ODD_VALUES:
        for _ in range(rng.choice((1, 3, 200))):
            parent[key] = [parent[key]] if rng.random() < 0.5 else {"value": parent[key]}
    elif isinstance(parent, dict):
        parent[rng.choice(("x", "", "value", 1, None, "name", f"{key} "))] = parent.pop(key)
    else:
        parent.insert(rng.randrange(len(parent)), copy.deepcopy(held if kind == 7 else rng.choice(odd)))


def _document(read: Callable[[str], Any], write: Callable[[Any], str]) -> Damage:
    """Return what damages a document in its structure, its text or its bytes."""

    def damaged(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
        kind = rng.random()
        if kind < 0.6:
            with suppress(Exception):  # what was damaged before may be no document, or too deep to be written
                return write(change_nodes(rng, read(data.decode("utf-8")))).encode()
        return in_text(rng, data, other) if kind < 0.85 else in_bytes(rng, data, other)

    return damaged


in_yaml = _document(yaml.safe_load, partial(yaml.safe_dump, sort_keys=False))
_in_json = _document(json.loads, json.dumps)


def in_json(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a JSON document changed in its structure, its text or its bytes, or one nested deeply."""
    if rng.random() < 0.1:
        depth = rng.choice((10, 1000, 100_000))
        return b"[" * depth + b"]" * rng.choice((0, depth))
    return _in_json(rng, data, other)


def in_text(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return text with lines and words changed, other line ends, encodings and indents."""
    lines = data.decode("utf-8", "replace").splitlines() or [""]
    if rng.random() < 0.5:
        words = [line.split(" ") for line in lines]
        odd = [str(value) for value in (*ODD_VALUES[:28], *ODD_VALUES[30:40], *ODD_CELLS)]
        lines = [" ".join(line) if isinstance(line, list) else line for line in change_nodes(rng, words, odd)]
    else:
        lines = [*change_nodes(rng, lines, ODD_LINES)]
    at = rng.randrange(len(lines) + 1)
    lines[at : at + 1] = [rng.choice(("", "", "", " ", "\t", "  ")) + line for line in lines[at : at + 1]]
    text = rng.choice(("\n", "\n", "\n", "\r\n", "\r", "\n\n")).join(lines)
    encoding = rng.choice(("utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1", "utf-32"))
    return text.encode(encoding, "replace")


def in_table(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a table of text with cells, rows, separators, quotes or bytes changed."""
    if rng.random() < 0.35:
        return rng.choice((in_bytes, in_bytes, in_text))(rng, data, other)
    rows = [line.split(",") for line in data.decode("utf-8", "replace").splitlines()] or [[""]]
    rows = [row if isinstance(row, list) else [row] for row in change_nodes(rng, rows, ODD_CELLS)]
    separator = rng.choice((",", ",", ",", ", ", ";", "\t", " ", "   ", " \t", "|", ",,", "\x00"))
    end = rng.choice(("", "", "", separator, "\t", " "))
    head = rng.choice(("", "", "", "\ufeff", "# a comment\n", "\n", "sep=;\n", '"'))
    text = head + rng.choice(("\n", "\n", "\r\n", "\r")).join(separator.join(r) + end for r in rows)
    return text.encode(rng.choice(("utf-8", "utf-8", "utf-8", "latin-1", "utf-16")), "replace")


def in_gzip(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return a compressed table damaged in its text or its bytes, or one that unpacks to 400 MB."""
    try:
        plain = gzip.decompress(data)
    except Exception:
        return in_bytes(rng, data, other)
    if rng.random() < 0.02:
        return gzip.compress(bytes(400_000_000), compresslevel=1)
    return gzip.compress(in_table(rng, plain)) if rng.random() < 0.5 else in_bytes(rng, data, other)


def in_setting(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return the setting of an effect, `name:parameter=value,…`, with odd values, twice, or other bytes."""
    text = data.decode("utf-8", "replace")
    odd = ("nan", "inf", "-inf", "-1", "1e308", "1e-300", "0", "0x1", "1_0", "", "x", "=", "1,1", "1e999")
    kind = rng.randrange(4)
    if kind == 0 and "=" in text:
        parts = text.split("=")
        at = rng.randrange(1, len(parts))
        _, comma, rest = parts[at].partition(",")
        parts[at] = rng.choice(odd) + comma + rest
        return "=".join(parts).encode()
    if kind == 1:
        return (text + "," + text.partition(":")[2]).encode()
    return in_bytes(rng, data, other)
