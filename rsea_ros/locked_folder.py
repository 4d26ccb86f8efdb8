"""Folders of a random name that last only while something is written, each with a lock on itself.

The system releases a lock when its process ends, in any way, so the next process recognises leftover folders.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

PREFIX = ".rsea-"
"""Of names that last only while something is written."""
LEFT_AFTER = 60.0
"""s, after which a folder without a lock is one that was left; a new one has its lock within milliseconds."""
_HOST = f"{zlib.crc32(os.uname().nodename.encode()):08x}"
"""Another machine's lock cannot be seen on every network mount: its folders are its own to remove."""
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


@dataclass(frozen=True)
class LockedFolder:
    """A folder for this process alone, with its lock."""

    path: Path
    lock: int

    def release(self) -> None:
        """Release the lock."""
        os.close(self.lock)


@dataclass(frozen=True)
class AbandonedFolder:
    """A folder whose process is gone. changed: s since the epoch, when a name in it last changed."""

    path: Path
    changed: float

    @property
    def is_old(self) -> bool:
        """Whether it is too old for one that is only about to get its lock."""
        return time.time() - self.changed > LEFT_AFTER


def name_of(kind: str) -> str:
    """Return the prefix of the names of this machine's folders of a kind."""
    return f"{PREFIX}{kind}-{_HOST}-"


def new_name(parent: Path, kind: str) -> Path:
    """Return a name in a folder that nobody has."""
    return parent / f"{name_of(kind)}{secrets.token_hex(8)}"


def make_locked(parent: Path, kind: str, mode: int = 0o700) -> LockedFolder:
    """Make a folder of a kind in a folder. Raises OSError."""
    path = new_name(parent, kind)
    path.mkdir(mode)
    lock = os.open(path, _FOLDER)
    with suppress(OSError):  # a file system without locks: its folders never count as left
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return LockedFolder(path, lock)


def abandoned_folders(parent: Path, kind: str) -> Iterator[AbandonedFolder]:
    """Yield folders of a kind and of this user in a folder whose process is gone; each is locked meanwhile.

    Safe for two processes at once, and beside running writers: the lock of a folder is held while it is
    examined.
    """
    entries: list[str] = []
    with suppress(OSError):
        entries = [entry.path for entry in os.scandir(parent) if entry.name.startswith(name_of(kind))]
    for entry in entries:
        with suppress(OSError), _hold_lock(Path(entry)) as folder:
            if folder.st_uid == os.geteuid():
                yield AbandonedFolder(Path(entry), folder.st_mtime)


@contextmanager
def _hold_lock(path: Path) -> Iterator[os.stat_result]:
    """Hold the lock of a folder; raise OSError where another process has it, or where it is no folder."""
    folder = os.open(path, _FOLDER)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield os.fstat(folder)
    finally:
        os.close(folder)
