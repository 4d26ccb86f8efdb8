"""Bags written."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import yaml

from msg_adapters.contents import METADATA, Remarks, Topic, metadata_text
from msg_adapters.mcap_storage import McapStorage
from msg_adapters.sqlite_file import SqliteStorage
from msg_adapters.topic_map import check_topic, definition
from rsea_ros.errors import BagError, OutputError
from rsea_ros.outputs import files
from rsea_ros.outputs.files import LockedFolder, make_stage
from rsea_ros.processes import hold_signals
from rsea_ros.records.record import IntArray

STORAGES: Mapping[str, tuple[str, type[McapStorage | SqliteStorage]]] = {
    "mcap": (".mcap", McapStorage),
    "sqlite3": (".db3", SqliteStorage),
}
"""By name: the suffix, and one file of a bag being written. Times are log times in ns; `flush` makes written
data safe against the end of this process, `sync` against a power cut; all raise OSError on a full disk."""
PARTS = {".mcap", ".db3", ".zstd"}
"""Suffixes of the files of a bag that is a directory, beside its metadata."""
INTERVAL = 1.0
"""Seconds of a recording that may be lost with a recorder that is killed, or with the power."""


class BagWriter:
    """Write a bag message by message, under the name NAME.partial until it is complete.

    path: a directory to be made, or a file where the name ends in .mcap or .db3.
    storage: 'mcap' or 'sqlite3', for a directory.
    recording: written data are worth keeping. Then Ctrl-C completes the bag, and a failure
    leaves NAME.partial, a readable bag. Otherwise either removes the data.
    force: an existing bag may be replaced.
    interval: s, after which recorded data are put on the disk. distribution: of ROS; empty: none wrote it.
    Raises BagError for a path that is taken and for a disk that is full.
    """

    def __init__(
        self, path: str | Path, storage: str = "mcap", *, recording: bool = True,
        remarks: Remarks | None = None, force: bool = False, interval: float = INTERVAL,
        distribution: str = "",
    ) -> None:  # fmt: skip
        self.path = Path(path)
        by_suffix = {suffix: name for name, (suffix, _) in STORAGES.items()}
        self._single = self.path.suffix in by_suffix
        self._kind = by_suffix.get(self.path.suffix, storage)
        if self._kind not in STORAGES:
            raise BagError(f"{path}: storage {storage!r}, expected one of {', '.join(STORAGES)}")
        self._recording, self._force, self._interval = recording, force, interval
        self.remarks, self._distribution = remarks or Remarks(), distribution or "rsea_ros"
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._span = (0, 0)
        self._flushed = time.monotonic()
        self._disk = ThreadPoolExecutor(1, "disk")
        self._syncing = Future[None]()
        self._syncing.set_result(None)
        self._stage: LockedFolder | None = None

    def __enter__(self) -> BagWriter:
        self._check_name()
        self._made: list[Path] = []
        try:
            with hold_signals():
                self._made = files.make_folder(self.path.parent)
                self.partial = self._new_directory()
                self._made.insert(0, self.partial)
                suffix, opened = STORAGES[self._kind]
                name = self.path.stem if self._single else self.path.name
                self._storage = opened(self.partial / f"{name}{suffix}")
                for folder in (self.partial, self.path.parent) if self._recording else ():
                    files.sync(folder)
        except OSError as error:
            self._clear()
            raise BagError(f"{error.filename or self.path}: cannot be made: {error.strerror}") from None
        except BaseException:
            self._clear()
            raise
        return self

    def write(self, topic: str, msgtype: str, log_time: int, raw: bytes) -> None:
        """Append a serialised message; log_time in ns since the epoch.

        Raises BagError for a topic that ROS could not have, and for a topic of another type than before.
        """
        with self._name_failure():
            key, known = self._known(topic, msgtype)
            self._storage.write(key, log_time, raw)
            self._count(known, 1, log_time, log_time)
        self.keep_up()

    def offer(self, topic: str, msgtype: str, qos: Sequence[Mapping[str, Any]]) -> None:
        """Declare a topic with the QoS that its publishers offer, before its first message."""
        if topic not in self._topics:
            self._declare(topic, msgtype, qos)

    def write_all(
        self, topics: Sequence[tuple[str, str]], which: IntArray, log_times: IntArray, raws: Sequence[bytes]
    ) -> None:
        """Append serialised messages, each of topics[which] (name, type); which, log_times: shape (n,), ns.

        Raises BagError as write does.
        """
        with self._name_failure():
            keys, known = zip(*(self._known(*topic) for topic in topics), strict=True)
            self._storage.write_all(np.array(keys)[which], log_times, raws)
            for i, count in enumerate(np.bincount(which, minlength=len(topics))):
                self._count(known[i], int(count), int(log_times.min()), int(log_times.max()))
        self.keep_up()

    def _known(self, topic: str, msgtype: str) -> tuple[int, Topic]:
        """Return key and topic, declared. Raises BagError for a topic of another type than before."""
        if topic not in self._topics:
            self._declare(topic, msgtype)
        key, known = self._topics[topic]
        if known.msgtype != msgtype:
            raise BagError(f"topic {topic}: is {known.msgtype} and {msgtype}, expected one type")
        return key, known

    def _declare(self, topic: str, msgtype: str, qos: Sequence[Mapping[str, Any]] = ()) -> None:
        check_topic(topic)
        known = Topic(topic, msgtype, definition(msgtype)[1], qos=qos)
        text = yaml.safe_dump(list(qos), sort_keys=False) if qos else "[]"
        self._topics[topic] = (self._storage.add(topic, msgtype, text), known)

    def _count(self, topic: Topic, messages: int, first: int, last: int) -> None:
        topic.count += messages
        span = self._span if self._span[1] else (first, last)
        self._span = (min(span[0], first), max(span[1], last))

    def keep_up(self) -> None:
        """Flush once in an interval, and let a thread wait for the disk; call it also while nothing comes."""
        if time.monotonic() - self._flushed > self._interval:
            self.flush()
            if self._recording and self._syncing.done():
                with self._name_failure():
                    self._syncing.result()
                self._syncing = self._disk.submit(self._storage.sync)

    def flush(self) -> None:
        """Make written data safe against the end of this process."""
        with self._name_failure():
            self._storage.flush()
        self._flushed = time.monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        complete = kind is None or (self._recording and issubclass(kind, KeyboardInterrupt))
        with hold_signals():
            self._disk.shutdown()
            try:
                if complete:
                    self._syncing.result()
                    self._complete()
            except OSError as failure:
                complete = False
                raise self._error(failure) from None
            finally:
                if not complete:
                    with suppress(OSError):
                        self._storage.abort()
                    if not self._recording:
                        self._clear()
                self._release()

    def _check_name(self) -> None:
        """Refuse a name that is taken by something that may not be replaced. Raises BagError."""
        if self.path.exists() or self.path.is_symlink():
            if not self._force:
                raise BagError(str(files.taken_error(self.path)))
            try:
                files.check_replaceable(self.path)
            except OutputError as error:
                raise BagError(str(error)) from None
            inside = self.path.iterdir() if self.path.is_dir() else ()
            if any(file.name != METADATA and file.suffix not in PARTS for file in inside):
                raise BagError(f"{self.path}: holds more than a bag, expected a new name")

    def _new_directory(self) -> Path:
        """Make a directory that nobody has: a stage, or NAME.partial, which a killed recorder leaves."""
        with files.name_errors(self.path):
            if not self._recording:
                self._stage = make_stage(self.path.parent, 0o777)
                return self._stage.path
            for number in count():
                path = self.path.with_name(f"{self.path.name}.partial{number or ''}")
                with suppress(FileExistsError):
                    path.mkdir()
                    break
        return path

    def _complete(self) -> None:
        """Close the file, add the metadata, and move everything to its name."""
        file, topics = self._storage.path, [topic for _, topic in self._topics.values()]
        known = metadata_text(file, self._kind, topics, self._span, self.remarks, self._distribution)
        if self._single:
            self._storage.remark(self.remarks.texts(), known)
        self._storage.close()
        if self._single:
            files.give_names([(file, self.path)], force=self._force)
            files.remove(self.partial)
            return
        files.remove(self.partial / METADATA)
        files.write_new(self.partial / METADATA, known)
        files.give_names([(self.partial, self.path)], force=self._force)

    def _clear(self) -> None:
        """Remove the new files, and the folders above them where they are empty."""
        for path in self._made[:1]:
            files.remove(path)
        for path in self._made[1:]:
            with suppress(OSError):
                path.rmdir()
        self._release()

    def _release(self) -> None:
        if self._stage is not None:
            self._stage.release()
            self._stage = None

    @contextmanager
    def _name_failure(self) -> Iterator[None]:
        """Raise BagError, with the file and what is kept, where the system fails."""
        try:
            yield
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: OSError) -> BagError:
        kept = f"; what was written until then is in {self.partial}" if self._recording else ""
        if isinstance(error, OutputError):
            return BagError(f"{error}{kept}")
        return BagError(f"{self.path}: cannot be written: {error.strerror or error}{kept}")
