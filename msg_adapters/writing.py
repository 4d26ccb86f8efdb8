"""Bags written aside and renamed when complete."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from msg_adapters import metadata
from msg_adapters.definitions import definition
from msg_adapters.mcap_storage import McapStorage
from msg_adapters.metadata import Topic
from msg_adapters.sqlite_storage import SqliteStorage
from msg_adapters.storage import Storage
from rsea_ros.errors import BagError

STORAGES: Mapping[str, tuple[str, Callable[[Path], Storage]]] = {
    "mcap": (".mcap", McapStorage),
    "sqlite3": (".db3", SqliteStorage),
}
FLUSH_INTERVAL = 1.0
"""Seconds of a recording that may be lost with a recorder that is killed."""


class BagWriter:
    """Write a bag message by message, under the name NAME.partial until it is complete.

    path: a directory to be made, or a file where the name ends in .mcap or .db3.
    storage: 'mcap' or 'sqlite3', for a directory.
    recording: what has been written is worth keeping. Then Ctrl-C completes the bag, and a failure
    leaves NAME.partial, a bag that can be read. Otherwise either removes what was written.
    Raises BagError for a path that is taken and for a disk that is full.
    """

    def __init__(
        self, path: str | Path, storage: str = "mcap", *, recording: bool = True, notes: Sequence[str] = ()
    ) -> None:
        self.path = Path(path)
        by_suffix = {suffix: name for name, (suffix, _) in STORAGES.items()}
        self._single = self.path.suffix in by_suffix
        self._kind = by_suffix.get(self.path.suffix, storage)
        if self._kind not in STORAGES:
            raise BagError(f"{path}: storage {storage!r}, expected one of {', '.join(STORAGES)}")
        self._recording = recording
        self.notes = list(notes)
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._span = (0, 0)
        self._flushed = time.monotonic()

    def __enter__(self) -> BagWriter:
        if self.path.exists() and not self._single:
            raise BagError(f"{self.path}: exists already, expected a new name")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.partial = _new_directory(self.path)
            suffix, opened = STORAGES[self._kind]
            self._storage = opened(
                self.partial / f"{self.path.stem if self._single else self.path.name}{suffix}"
            )
        except OSError as error:
            raise BagError(f"{error.filename or self.path}: cannot be made: {error.strerror}") from None
        return self

    def write(self, topic: str, msgtype: str, log_time: int, raw: bytes) -> None:
        """Append a serialised message; log_time in ns since the epoch."""
        try:
            if topic not in self._topics:
                known = Topic(topic, msgtype, definition(msgtype).digest)
                self._topics[topic] = (self._storage.add(topic, msgtype), known)
            key, known = self._topics[topic]
            self._storage.write(key, log_time, raw)
            known.count += 1
            first, last = self._span if self._span[1] else (log_time, log_time)
            self._span = (min(first, log_time), max(last, log_time))
            if time.monotonic() - self._flushed > FLUSH_INTERVAL:
                self.flush()
        except OSError as error:
            raise self._error(error) from None

    def flush(self) -> None:
        """Make what was written safe against the end of this process."""
        try:
            self._storage.flush()
        except OSError as error:
            raise self._error(error) from None
        self._flushed = time.monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        complete = kind is None or (self._recording and issubclass(kind, KeyboardInterrupt))
        try:
            if complete:
                self._complete()
        except OSError as failure:
            complete = False
            raise self._error(failure) from None
        finally:
            if not complete:
                self._abandon()

    def _complete(self) -> None:
        """Close the file, add the metadata, and move everything to its name."""
        self._storage.close()
        file = self._storage.path
        if self._single:
            file.replace(self.path)
            self.partial.rmdir()
            return
        topics = [topic for _, topic in self._topics.values()]
        text = metadata.text(file, self._kind, topics, self._span, self.notes)
        (self.partial / metadata.NAME).write_text(text)
        os.rename(self.partial, self.path)

    def _abandon(self) -> None:
        with suppress(OSError):
            self._storage.abort()
        if not self._recording:
            shutil.rmtree(self.partial, ignore_errors=True)

    def _error(self, error: OSError) -> BagError:
        kept = f"; what was written until then is in {self.partial}" if self._recording else ""
        return BagError(f"{self.path}: cannot be written: {error.strerror or error}{kept}")


def _new_directory(path: Path) -> Path:
    """Make a directory NAME.partial that is not another's: a killed recorder's leavings stay."""
    number = 0
    while True:
        partial = path.with_name(f"{path.name}.partial{number or ''}")
        try:
            partial.mkdir()
            return partial
        except FileExistsError:
            number += 1
