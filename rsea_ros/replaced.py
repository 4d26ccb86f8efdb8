"""Files that --force replaces: put aside until the whole set has its names, put back if that fails.

A file lies under its name in a locked folder beside its destination. A killed writer leaves it there; the
next run on the same place puts it back.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rsea_ros.locked_folder import AbandonedFolder, LockedFolder, abandoned_folders, make_locked, new_name

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
