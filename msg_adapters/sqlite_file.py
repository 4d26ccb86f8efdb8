"""rosbag2 sqlite3 files (schema versions 1 to 4: the tables `topics` and `messages`)."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from msg_adapters.contents import Contents, Messages

MAGIC = b"SQLite format 3\x00"
TOPICS = "SELECT id, name, type FROM topics WHERE typeof(name) = 'text' AND typeof(type) = 'text'"
MESSAGES = """SELECT topic_id, timestamp, data FROM messages
    WHERE typeof(timestamp) = 'integer' AND typeof(data) = 'blob'"""
"""The types are asked for because a damaged page gives NULL."""


def scan(path: Path, contents: Contents) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    A file that breaks off gives what is readable, and a note.
    Raises ValueError for a file that is no rosbag2 database.
    """
    with path.open("rb") as file:
        header = file.read(100)
    if not header.startswith(MAGIC):
        raise ValueError(f"no sqlite3 file, expected it to start with {MAGIC!r}")
    page = int.from_bytes(header[16:18], "big")
    pages = int.from_bytes(header[28:32], "big")
    if path.stat().st_size < pages * (65536 if page == 1 else page):
        contents.notes.append("cut off, read as far as it goes")
    try:
        with closing(_connect(path)) as database:
            topics = database.execute(TOPICS).fetchall()
            sinks = {key: contents.sink(name, msgtype) for key, name, msgtype in topics}
            _messages(database, {key: sink for key, sink in sinks.items() if sink is not None}, contents)
    except sqlite3.Error as error:
        raise ValueError(f"no rosbag2 database: {error}") from None


def _connect(path: Path) -> sqlite3.Connection:
    """Open for reading.

    A database on a read-only medium that wants recovery is read as it stands, and one that is shorter than
    its header says (which the pragma is for) up to where it ends.
    """
    for mode in ("mode=ro", "immutable=1"):
        database = sqlite3.connect(f"{path.resolve().as_uri()}?{mode}", uri=True)
        database.execute("PRAGMA writable_schema=ON")
        try:
            database.execute("SELECT count(*) FROM sqlite_master")
            break
        except sqlite3.OperationalError:
            database.close()
    return database


def _messages(database: sqlite3.Connection, sinks: dict[int, Messages], contents: Contents) -> None:
    keys = ",".join(str(int(key)) for key in sinks)
    try:
        rows = database.execute(f"{MESSAGES} AND topic_id IN ({keys})")
        for key, log_time, raw in rows:
            sinks[key].log_times.append(log_time)
            sinks[key].raw.append(raw)
    except sqlite3.DatabaseError as error:
        contents.notes.append(f"breaks off ({error}), read up to there")
