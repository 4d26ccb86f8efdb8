"""The last minutes in memory, and bags of them: one before a change and one after it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from msg_adapters import BagWriter
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.outputs.files import unused_path


class Message(NamedTuple):
    """A serialised message. at: ns of its arrival."""

    topic: str
    msgtype: str
    at: int
    raw: bytes


class Ring:
    """The newest messages, bounded by seconds and megabytes."""

    def __init__(self, seconds: float, megabytes: float) -> None:
        self._span, self._most = round(seconds * SECOND), round(megabytes * 1e6)
        self._messages: deque[Message] = deque()
        self.size = 0

    def add(self, topic: str, msgtype: str, at: int, raw: bytes) -> None:
        """Keep a message, and drop those too old or too many."""
        self._messages.append(Message(topic, msgtype, at, raw))
        self.size += len(raw)
        first = self._messages[0]
        while self.size > self._most or abs(at - first.at) > self._span:
            self.size -= len(self._messages.popleft().raw)
            if not self._messages:
                break
            first = self._messages[0]

    def messages(self) -> list[Message]:
        """Return the kept messages."""
        return list(self._messages)


class Keeper:
    """Writes bags in a thread. folder: of the bags; most: that it may hold; after: s from alarm to bag."""

    def __init__(self, ring: Ring, folder: Path, most: int, after: float) -> None:
        self._ring, self._folder, self._most, self._after = ring, folder, most, after
        self._pool = ThreadPoolExecutor(1, "bags")
        self._due: tuple[float, str, int] | None = None
        self._writing: Future[Path] | None = None
        self.last: Path | None = None
        self.trouble = ""

    def ask(self, code: str, since: int) -> None:
        """Request a bag of the memory `after` seconds from now. since: ns, of the change."""
        if self._due is None:
            self._due = (time.monotonic() + self._after, code, since)

    def poll(self) -> Path | None:
        """Begin bags that are due; return the folder of one just completed."""
        if self._writing is not None and self._writing.done():
            done, self._writing = self._writing, None
            if error := done.exception():
                self.trouble = f"no bag kept: {error}"
                return None
            self.last, self.trouble = done.result(), ""
            return self.last
        if self._due is not None and self._writing is None and time.monotonic() >= self._due[0]:
            self._begin()
        return None

    def close(self) -> None:
        """Write requested bags, and end."""
        if self._due is not None and self._writing is None:
            self._begin()
        self._pool.shutdown()

    def _begin(self) -> None:
        assert self._due is not None
        (_, code, since), self._due = self._due, None
        held = len([p for p in self._folder.iterdir() if p.is_dir()]) if self._folder.is_dir() else 0
        if held >= self._most:
            self.trouble = f"no bag kept: {self._folder} holds {held}, expected less than {self._most} (bags)"
            return
        path = unused_path(self._folder / f"{time.strftime('%Y%m%d-%H%M%S')}-{code}")
        self._writing = self._pool.submit(_write, path, self._ring.messages(), since)


def _write(path: Path, messages: Sequence[Message], since: int) -> Path:
    """Write bags `before` and `after` an instant (ns), those that have messages, into a folder."""
    for name, part in (
        ("before", [m for m in messages if m.at < since]),
        ("after", [m for m in messages if m.at >= since]),
    ):
        if part:
            with BagWriter(path / name, recording=False) as bag:
                for message in sorted(part, key=lambda m: m.at):
                    bag.write(message.topic, message.msgtype, message.at, message.raw)
    return path
