"""What a result replaces lies aside in a locked folder until the new one stands; what a crash left is put back.

A file lies under its name in a locked folder beside its destination. A killed writer leaves it there; the
next run on the same place puts it back.

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


KIND, REMOVABLE = "old", "stage"
"""A folder of the first kind is put back, one of the second is removed by the next writer."""


class Replaced:
    """The folders, one for each destination, in which one writer puts aside the files that it replaces."""

    def __init__(self) -> None:
        self._folders: dict[Path, LockedFolder] = {}

    def place(self, target: Path) -> Path:
        """Return the name that a target gets while it is aside."""
        if target.parent not in self._folders:
            self._folders[target.parent] = make_locked(target.parent, KIND)
        return self._folders[target.parent].path / target.name

    def give_up(self) -> list[Path]:
        """Make the replacement final; return the folders, for removal."""
        given_up = []
        for parent, folder in self._folders.items():
            given_up.append(new_name(parent, REMOVABLE))
            os.rename(folder.path, given_up[-1])
        return given_up

    def close(self) -> None:
        """Remove the empty folders, and release the locks."""
        for folder in self._folders.values():
            with suppress(OSError):
                folder.path.rmdir()
            folder.release()


@contextmanager
def putting_aside() -> Iterator[Replaced]:
    """Give a writer its Replaced, and close it."""
    replaced = Replaced()
    try:
        yield replaced
    finally:
        replaced.close()


def put_back(parent: Path) -> None:
    """Restore the files that killed writers of this user put aside in a folder.

    A file that has taken the name since is replaced only where it is the killed writer's; else the old one
    gets the first free of NAME.old, NAME.old-2, …
    """
    for folder in abandoned_folders(parent, KIND):
        with suppress(OSError):  # a file that cannot be put back stays, and stops nothing
            names = os.listdir(folder.path)
            for name in names:
                _put_back(folder.path / name, parent / name, folder)
            if names or folder.is_old:
                folder.path.rmdir()


def _put_back(old: Path, target: Path, folder: AbandonedFolder) -> None:
    """Give one file or folder its name back. Raises OSError."""
    if not os.path.lexists(target):
        os.rename(old, target)
    elif old.is_dir() or not target.is_file() or target.stat().st_mtime > folder.changed:
        os.rename(old, _free(target))
    elif old.samefile(target):
        old.unlink()
    else:
        os.rename(old, target)


def _free(target: Path) -> Path:
    """Return a name beside a target that nothing has."""
    number, path = 1, target.with_name(f"{target.name}.old")
    while os.path.lexists(path):
        number += 1
        path = target.with_name(f"{target.name}.old-{number}")
    return path
