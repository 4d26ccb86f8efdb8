"""rosbag2 sqlite3 files (schema versions 1 to 4: the tables `topics` and `messages`)."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from msg_adapters.contents import Contents, Messages

MAGIC = b"SQLite format 3\x00"


def scan(path: Path, contents: Contents) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    A file that breaks off gives what is readable, and a note.
    Raises ValueError for a file that is no rosbag2 database.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"no sqlite3 file, expected it to start with {MAGIC!r}")
    try:
        with closing(_connect(path)) as database:
            topics = database.execute("SELECT id, name, type FROM topics").fetchall()
            sinks = {key: contents.sink(name, msgtype) for key, name, msgtype in topics}
            _messages(database, {key: sink for key, sink in sinks.items() if sink is not None}, contents)
    except sqlite3.Error as error:
        raise ValueError(f"no rosbag2 database: {error}") from None


def _connect(path: Path) -> sqlite3.Connection:
    """Open for reading; a database on a read-only medium that wants recovery is read as it stands."""
    uri = path.resolve().as_uri()
    database = sqlite3.connect(f"{uri}?mode=ro", uri=True)
    try:
        database.execute("SELECT count(*) FROM sqlite_master")
    except sqlite3.OperationalError:
        database.close()
        database = sqlite3.connect(f"{uri}?immutable=1", uri=True)
    return database


def _messages(database: sqlite3.Connection, sinks: dict[int, Messages], contents: Contents) -> None:
    keys = ",".join(str(int(key)) for key in sinks)
    rows = database.execute(f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({keys})")
    try:
        for key, log_time, raw in rows:
            sinks[key].log_times.append(log_time)
            sinks[key].raw.append(raw)
    except sqlite3.DatabaseError as error:
        contents.notes.append(f"breaks off ({error}), read up to there")
