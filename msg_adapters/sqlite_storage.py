"""rosbag2 sqlite3 files (schema version 4), committed at each flush."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from msg_adapters.metadata import VERSION
from msg_adapters.topic_map import definition
from rsea_ros.outputs.files import create
from rsea_ros.records.record import IntArray

TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
    encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema VALUES (4, 'rsea_ros');
"""
TOPIC = "INSERT INTO topics VALUES (NULL, ?, ?, 'cdr', '[]', ?)"
DEFINITION = "INSERT INTO message_definitions VALUES (NULL, ?, 'ros2msg', ?, ?)"
METADATA = f"INSERT INTO metadata VALUES (NULL, {VERSION}, ?)"
MESSAGE = "INSERT INTO messages VALUES (NULL, ?, ?, ?)"


class SqliteStorage:
    """One sqlite3 file being written (see Storage)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._types: set[str] = set()
        self._rows: list[tuple[int, int, bytes]] = []
        os.close(create(path))
        self._database = sqlite3.connect(path, check_same_thread=False)
        with _system_errors():
            self._database.executescript(TABLES)

    def add(self, topic: str, msgtype: str) -> int:
        """Declare a topic; return its key."""
        text, digest = definition(msgtype)
        with _system_errors():
            if msgtype not in self._types:
                self._types.add(msgtype)
                self._database.execute(DEFINITION, (msgtype, text, digest))
            return int(self._database.execute(TOPIC, (topic, msgtype, digest)).lastrowid or 0)

    def write(self, key: int, log_time: int, raw: bytes) -> None:
        """Append a serialised message."""
        self._rows.append((key, log_time, raw))

    def write_all(self, keys: IntArray, log_times: IntArray, raws: Sequence[bytes]) -> None:
        """Append serialised messages; keys, log_times: shape (n,)."""
        self._rows += zip(keys.tolist(), log_times.tolist(), raws, strict=True)

    def flush(self) -> None:
        """Commit the messages. Raises OSError when the disk is full."""
        with _system_errors():
            self._database.executemany(MESSAGE, self._rows)
            self._database.commit()
        self._rows.clear()

    def sync(self) -> None:
        """Do nothing: a commit waits for the disk."""

    def remark(self, texts: Mapping[str, str], metadata: str) -> None:
        """Keep the metadata of the bag, which hold the texts too, where rosbag2 keeps them."""
        with _system_errors():
            self._database.execute(METADATA, (metadata,))

    def close(self) -> None:
        """Commit the rest."""
        self.flush()
        self._database.close()

    def abort(self) -> None:
        """Close the file; flushed data stay."""
        self._database.close()


@contextmanager
def _system_errors() -> Iterator[None]:
    """Turn an error of sqlite into the system's. Raises OSError."""
    try:
        yield
    except sqlite3.Error as error:
        raise OSError(f"{error}") from error
