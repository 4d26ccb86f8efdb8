"""rosbag2 sqlite3 files, read (schema versions 1 to 4) and written (version 4, committed at each flush).

A database may bring program of its own: views, triggers, generated columns. Only plain tables are read, as
they stand, without their journals, and no more than the file can hold.
"""

import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from msg_adapters.compression import Allowance
from msg_adapters.contents import LARGEST, VERSION, Contents, Messages, remarks_in
from msg_adapters.topic_map import definition
from rsea_ros.outputs.files import create
from rsea_ros.records.record import IntArray

MAGIC = b"SQLite format 3\x00"
TOPICS = "SELECT id, name, type FROM topics"
MESSAGES = "SELECT topic_id, timestamp, data FROM messages"
METADATA = f"SELECT metadata FROM metadata WHERE length(metadata) <= {LARGEST} LIMIT 1"
COLUMNS = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
PRAGMAS = ("trusted_schema=OFF", "cell_size_check=ON", "query_only=ON")
JOURNALS = ("-wal", "-journal")

_STEPS = 10_000
_STEPS_PER_BYTE = 20
"""Steps of sqlite's machine until a query is stopped: a row takes some 12 and not less than 5 bytes."""
_STEPS_AT_LEAST = 10_000_000
_ROW = 4
"""Bytes that a row takes at the least."""


def scan(path: Path, contents: Contents, allowance: Allowance) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    Nothing in it is packed, so that it needs no allowance.

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
    for journal in (path.with_name(path.name + suffix) for suffix in JOURNALS):
        if journal.exists() and journal.stat().st_size:  # with changes that are not in the file, or to undo
            detail = f"{journal.name} was left aside (recorder killed?): the last rows may be missing"
            contents.tell("cut_off", path.name, detail)
    budget = iter(range(max(_STEPS_AT_LEAST, _STEPS_PER_BYTE * size) // _STEPS))
    try:
        with closing(_connect(path, cut_off)) as database:
            database.set_progress_handler(lambda: next(budget, None) is None, _STEPS)
            _check_tables(database)
            _messages(database, _topics(database, path, contents), contents, path, size)
            _remarks(database, path, contents)
    except (sqlite3.Error, sqlite3.Warning) as error:
        raise ValueError(f"no rosbag2 database: {error}") from None


def _connect(path: Path, cut_off: bool) -> sqlite3.Connection:
    """Open a database unchanged: nothing is recovered, locked or written.

    cut_off: shorter than its header says, which the last pragma is for.
    """
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    database.text_factory = bytes
    for pragma in (*PRAGMAS, *(("writable_schema=ON",) if cut_off else ())):
        database.execute(f"PRAGMA {pragma}")
    return database


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
        contents.take(remarks_in(path, data if isinstance(data, bytes) else b""))


def _text(data: bytes | str) -> str:
    return data.decode(errors="replace") if isinstance(data, bytes) else data


class SqliteStorage:
    """One sqlite3 file being written, as McapStorage is (see writing.STORAGES)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._types: set[str] = set()
        self._rows: list[tuple[int, int, bytes]] = []
        os.close(create(path))
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer  # costs a reader 50 ms

        self._database = sqlite3.connect(path, check_same_thread=False)
        with _system_errors():
            self._database.executescript(Sqlite3Writer.SQLITE_SCHEMA)

    def add(self, topic: str, msgtype: str, offered: str = "[]") -> int:
        text, digest = definition(msgtype)
        with _system_errors():
            if msgtype not in self._types:
                self._types.add(msgtype)
                row = "INSERT INTO message_definitions VALUES (NULL, ?, 'ros2msg', ?, ?)"
                self._database.execute(row, (msgtype, text, digest))
            row = "INSERT INTO topics VALUES (NULL, ?, ?, 'cdr', ?, ?)"
            return int(self._database.execute(row, (topic, msgtype, offered, digest)).lastrowid or 0)

    def write(self, key: int, log_time: int, raw: bytes) -> None:
        self._rows.append((key, log_time, raw))

    def write_all(self, keys: IntArray, log_times: IntArray, raws: Sequence[bytes]) -> None:
        self._rows += zip(keys.tolist(), log_times.tolist(), raws, strict=True)

    def flush(self) -> None:
        """Commit the messages. Raises OSError when the disk is full."""
        with _system_errors():
            self._database.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", self._rows)
            self._database.commit()
        self._rows.clear()

    def sync(self) -> None:
        """Do nothing: a commit waits for the disk."""

    def remark(self, texts: Mapping[str, str], known: str) -> None:
        """Keep the metadata of the bag, which hold the texts too, where rosbag2 keeps them."""
        with _system_errors():
            self._database.execute(f"INSERT INTO metadata VALUES (NULL, {VERSION}, ?)", (known,))

    def close(self) -> None:
        """Commit the rest."""
        self.flush()
        self._database.close()

    def abort(self) -> None:
        self._database.close()


@contextmanager
def _system_errors() -> Iterator[None]:
    """Turn an error of sqlite into the system's. Raises OSError."""
    try:
        yield
    except sqlite3.Error as error:
        raise OSError(f"{error}") from error
