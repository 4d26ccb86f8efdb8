"""Folders that last only while something is written into them, and what a killed writer has left of them.

A stage holds a lock on itself, which the system lets go of when its process ends, however it ends.
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

from rsea_ros.files import PREFIX, remove

LEFT_AFTER = 60.0
"""s, after which a stage without a lock is one that was left; a new one has its lock within milliseconds."""
_NAME = f"{PREFIX}stage-{zlib.crc32(os.uname().nodename.encode()):08x}-"
"""Another machine's lock cannot be seen on every network mount: its stages are its own to remove."""
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


@dataclass(frozen=True)
class Stage:
    """A folder for this process alone, with its lock."""

    path: Path
    lock: int

    def release(self) -> None:
        """Let go of a folder that has its final name."""
        os.close(self.lock)

    def remove(self) -> None:
        """Remove the folder, if it can be removed."""
        remove(self.path)
        self.release()


def make_stage(parent: Path, mode: int = 0o700) -> Stage:
    """Make a stage in a folder, and remove what killed writers left there. Raises OSError."""
    remove_left(parent)
    path = parent / f"{_NAME}{secrets.token_hex(8)}"
    path.mkdir(mode)
    lock = os.open(path, _FOLDER)
    with suppress(OSError):  # a file system without locks: none of its stages is ever removed
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return Stage(path, lock)


def remove_left(parent: Path) -> None:
    """Remove stages of this user in a folder whose process is gone, and that are older than LEFT_AFTER.

    Safe for two at once, and beside writers at work: who removes holds the lock of what is removed.
    """
    with suppress(OSError):
        for entry in list(os.scandir(parent)):
            if entry.name.startswith(_NAME):
                _remove_if_left(Path(entry))


def _remove_if_left(path: Path) -> None:
    with suppress(OSError), _opened(path) as folder:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        status = os.fstat(folder)
        if status.st_uid == os.geteuid() and time.time() - status.st_mtime > LEFT_AFTER:
            remove(path)


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    folder = os.open(path, _FOLDER)
    try:
        yield folder
    finally:
        os.close(folder)
