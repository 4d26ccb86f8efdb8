"""Damage to files: bytes without regard to the format, and parts of each format that is read.

A damaged file of a format is, in a share of the draws, one with other bytes; else its parts are replaced,
dropped, doubled and renamed: records of MCAP, statements on a database, nodes of YAML and JSON, lines and
cells of text.
"""

import copy
import json
import random
import re
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import yaml

Damage = Callable[[random.Random, bytes, bytes], bytes]
"""Draws, a well-formed file and another one: a damaged file."""
ODD_NUMBERS = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)
ODD_DOUBLES = (
    float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 1e-300, 0.0, -0.0, 1e30, 1e31,
)  # fmt: skip


def in_bytes(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return bytes with one or a few places changed: a bit, a byte, a number, or a part left out, put in,
    doubled, blanked or of another file."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        data = data or rng.randbytes(8)
        at, size = rng.randrange(len(data)), rng.choice((1, 4, 16, 256, 4096))
        head, tail, put, from_ = data[:at], data[at:], _odd_number(rng), other or data
        changed = (
            (2, bytes((tail[0] ^ 1 << rng.randrange(8),)) + tail[1:]),
            (1, bytes((rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))),)) + tail[1:]),
            (3, put + tail[len(put) :]),
            (1, b""),
            (1, tail[rng.choice((1, 2, 4, 8, 64, 512)) :]),
            (1, rng.randbytes(rng.choice((1, 2, 4, 8, 64))) + tail),
            (1, tail[:size] * rng.choice((2, 2, 4, 51)) + tail[size:]),
            (1, rng.choice((b"\0", b"\xff")) * min(size, len(tail)) + tail[size:]),
            (1, from_[rng.randrange(len(from_)) :]),
        )
        shares, parts = zip(*changed, strict=True)
        data = head + bytes(rng.choices(parts, shares)[0])
    return data


def _odd_number(rng: random.Random) -> bytes:
    """Return an odd whole number or double, as lengths, counts, stamps and values are."""
    code, order = rng.choice("HIIQd"), rng.choice("<<<>")
    if code == "d":
        return struct.pack(f"{order}d", rng.choice(ODD_DOUBLES))
    return struct.pack(f"{order}{code}", rng.choice(ODD_NUMBERS) & (1 << 8 * struct.calcsize(code)) - 1)


MAGIC = b"\x89MCAP0\r\n"


def in_mcap(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return an MCAP file damaged in its bytes, or with a record dropped, doubled, renamed or changed.

    test/msg_adapters/test_damaged.py damages messages in chunks whose checksum fits.
    """
    at, records = len(MAGIC), list[tuple[int, bytes]]()
    while at + 9 <= len(data) - len(MAGIC):
        opcode, size = struct.unpack_from("<BQ", data, at)
        records.append((opcode, data[at + 9 : at + 9 + size]))
        at += 9 + size
    if at != len(data) - len(MAGIC) or not records or rng.random() < 0.25:
        return in_bytes(rng, data, other)
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(records))
        opcode, body = records[at]
        odd = rng.choice((0, 1, 3, 4, 5, 6, 0x0F, 0x0B, 0x42, 0xFF))
        changed = [(opcode, in_bytes(rng, body))]
        records[at : at + 1] = rng.choice(([], [records[at]] * 2, [(odd, body)], *[changed] * 5))
        records = records or changed
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
in_json = _document(json.loads, json.dumps)


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


def in_setting(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return the setting of an effect, `name:parameter=value,…`, with odd values, or other bytes."""
    if rng.random() < 0.5:
        return in_bytes(rng, data, other)
    odd = b"=" + rng.choice(ODD_CELLS).encode()
    return re.sub(b"=[^,]*", lambda found: rng.choice((found[0], odd)), data)


def in_some(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return the file as it is, which may be an odd one, or damaged in its bytes."""
    return data if rng.random() < 0.3 else in_bytes(rng, data, other)
