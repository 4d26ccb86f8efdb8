"""rosbag2 sqlite3 files (schema versions 1 to 4: the tables `topics` and `messages`).

A database may bring program of its own: views, triggers, generated columns. Only plain tables are read, as
they stand, without their journals, and no more than the file can hold.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from msg_adapters import metadata
from msg_adapters.contents import Contents, Messages
from msg_adapters.metadata import LARGEST

MAGIC = b"SQLite format 3\x00"
TOPICS = "SELECT id, name, type FROM topics"
MESSAGES = "SELECT topic_id, timestamp, data FROM messages"
METADATA = f"SELECT metadata FROM metadata WHERE length(metadata) <= {LARGEST} LIMIT 1"
COLUMNS = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
PRAGMAS = ("trusted_schema=OFF", "cell_size_check=ON", "query_only=ON")
JOURNALS = ("-wal", "-journal")

_STEPS = 10_000
_STEPS_PER_BYTE = 20
"""Steps of sqlite's machine: a row takes some 12 of them and not less than 5 bytes."""
_STEPS_AT_LEAST = 10_000_000
_ROW = 4
"""Bytes that a row takes at the least."""


def scan(path: Path, contents: Contents) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    A file that breaks off gives its readable part and a note.
    Raises ValueError for a file that is not a rosbag2 database.
    """
    with path.open("rb") as file:
        header = file.read(100)
    if not header.startswith(MAGIC):
        raise ValueError(f"no sqlite3 file, expected it to start with {MAGIC!r}")
    size = path.stat().st_size
    page = int.from_bytes(header[16:18], "big")
    pages = int.from_bytes(header[28:32], "big")
    cut_off = size < pages * (65536 if page == 1 else page)
    if cut_off:
        contents.notes.append("cut off, read as far as it goes")
        contents.tell("cut_off", path.name, f"{size} bytes of {pages} pages, read as far as it goes")
    _look_for_journals(path, contents)
    try:
        with closing(_connect(path, cut_off)) as database:
            database.set_progress_handler(_allowance(size), _STEPS)
            _check_tables(database)
            _messages(database, _topics(database, path, contents), contents, path, size)
            _remarks(database, path, contents)
    except (sqlite3.Error, sqlite3.Warning) as error:
        raise ValueError(f"no rosbag2 database: {error}") from None


def _look_for_journals(path: Path, contents: Contents) -> None:
    """Report a journal with changes that are not in the file yet, or must be undone."""
    for suffix in JOURNALS:
        journal = path.with_name(path.name + suffix)
        if journal.exists() and journal.stat().st_size:
            detail = f"{journal.name} was left aside (recorder killed?): the last rows may be missing"
            contents.tell("cut_off", path.name, detail)


def _connect(path: Path, cut_off: bool) -> sqlite3.Connection:
    """Open a database unchanged: nothing is recovered, locked or written.

    cut_off: shorter than its header says, which the last pragma is for.
    """
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    database.text_factory = bytes
    for pragma in (*PRAGMAS, *(("writable_schema=ON",) if cut_off else ())):
        database.execute(f"PRAGMA {pragma}")
    return database


def _allowance(size: int) -> Callable[[], bool]:
    """Return a handler that stops a query that takes too long for the size of the file."""
    left = max(_STEPS_AT_LEAST, _STEPS_PER_BYTE * size)

    def over() -> bool:
        nonlocal left
        left -= _STEPS
        return left < 0

    return over


def _check_tables(database: sqlite3.Connection) -> None:
    """Raises ValueError where topics and messages are anything but plain tables."""
    for name, needed in COLUMNS.items():
        rows = database.execute("SELECT type, rootpage FROM sqlite_master WHERE name = ?", (name,)).fetchall()
        if [kind for kind, _ in rows] != [b"table"] or not rows[0][1]:
            kinds = ", ".join(_text(kind) for kind, _ in rows) or "missing"
            raise ValueError(f"no rosbag2 database: {name!r} is {kinds}, expected a plain table")
        columns = database.execute(f"PRAGMA table_xinfo({name})").fetchall()
        plain = {_text(column) for _, column, _, _, _, _, hidden in columns if not hidden}
        if missing := sorted(needed - plain):
            raise ValueError(f"no rosbag2 database: no plain column {missing[0]!r} in {name!r}")


def _topics(database: sqlite3.Connection, path: Path, contents: Contents) -> dict[int, Messages]:
    """Return where the messages of each topic go, by its key."""
    sinks = {}
    for key, name, msgtype in database.execute(TOPICS):
        if isinstance(key, int) and isinstance(name, bytes) and isinstance(msgtype, bytes):
            sinks[key] = contents.sink(_text(name), _text(msgtype))
        else:
            contents.tell("damaged_records", path.name, f"a row of topics is {key!r:.40}, {name!r:.40}")
    return {key: sink for key, sink in sinks.items() if sink is not None}


def _messages(
    database: sqlite3.Connection, sinks: dict[int, Messages], contents: Contents, path: Path, size: int
) -> None:
    """Read the messages; damaged rows (a damaged page gives NULL) are counted."""
    known = {key for (key,) in database.execute("SELECT id FROM topics")}
    damaged = rows = total = 0
    try:
        for key, log_time, raw in database.execute(MESSAGES):
            rows += 1
            total += len(raw) if isinstance(raw, bytes) else 0
            if total > size or _ROW * rows > size:
                raise sqlite3.DatabaseError("its rows hold more than its pages can")
            if not (isinstance(log_time, int) and isinstance(raw, bytes)) or key not in known:
                damaged += 1
            elif key in sinks:
                sinks[key].log_times.append(log_time)
                sinks[key].raw.append(raw)
    except (sqlite3.Error, OverflowError) as error:
        contents.notes.append(f"breaks off ({error}), read up to there")
        contents.tell("cut_off", path.name, f"breaks off after {rows} rows ({error})")
    if damaged:
        detail = "rows without topic, log time or data were left out"
        contents.tell("damaged_messages", path.name, detail, damaged, "messages", damaged / rows)


def _remarks(database: sqlite3.Connection, path: Path, contents: Contents) -> None:
    """Take notes and faults from the metadata of a bag of one file; other recorders may leave none."""
    try:
        rows = database.execute(METADATA).fetchall()
    except sqlite3.Error:
        return
    for (data,) in rows:
        remarks = metadata.remarks_in(path, data if isinstance(data, bytes) else b"")
        contents.notes.extend(remarks.notes)
        contents.faults.extend(remarks.faults)


def _text(data: bytes | str) -> str:
    return data.decode(errors="replace") if isinstance(data, bytes) else data
