"""Temporary folders for files that are being written, and the removal of those of killed writers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rsea_ros.files import remove
from rsea_ros.locked_folder import LockedFolder, abandoned_folders, make_locked
from rsea_ros.replaced import put_back

KIND = "stage"


@dataclass(frozen=True)
class Stage(LockedFolder):
    """A folder in which files are written before they get their names."""

    def remove(self) -> None:
        """Remove the folder, if it can be removed."""
        remove(self.path)
        self.release()


def make_stage(parent: Path, mode: int = 0o700) -> Stage:
    """Make a stage in a folder, and remove stages of killed writers in it. Raises OSError."""
    put_back(parent)
    remove_left(parent)
    folder = make_locked(parent, KIND, mode)
    return Stage(folder.path, folder.lock)


def remove_left(parent: Path) -> None:
    """Remove stages of this user in a folder whose process is gone, and that are older than LEFT_AFTER."""
    for folder in abandoned_folders(parent, KIND):
        if folder.is_old:
            remove(folder.path)
