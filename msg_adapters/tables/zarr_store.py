"""Where the files of a zarr group lie: in a directory, or in a tar file of one as data hubs ship them."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Protocol

GROUP, ARRAY = ".zgroup", ".zarray"
LARGEST_FILE = 1 << 30
"""Bytes of one file of a group: a chunk."""


class ArrayStore(Protocol):
    """The files of a group."""

    @property
    def arrays(self) -> tuple[str, ...]:
        """The names of its arrays, in their order."""

    def read(self, array: str, name: str) -> bytes:
        """Return a file of an array. Raises ValueError where it is missing."""


@dataclass(frozen=True)
class _Directory:
    path: Path
    arrays: tuple[str, ...]

    def read(self, array: str, name: str) -> bytes:
        file = self.path / array / name
        if not file.is_file():
            raise _missing_error(array, name)
        _check_size(array, name, file.stat().st_size)
        return file.read_bytes()


@dataclass(frozen=True)
class _Tar:
    tar: tarfile.TarFile
    members: Mapping[str, tarfile.TarInfo]
    arrays: tuple[str, ...]

    def read(self, array: str, name: str) -> bytes:
        member = self.members.get(f"{array}/{name}")
        file = member and self.tar.extractfile(member)
        if not (member and file):
            raise _missing_error(array, name)
        _check_size(array, name, member.size)
        content = file.read()
        if len(content) < member.size:
            raise ValueError(f"{array}/{name} has {len(content)} of {member.size} bytes; a file cut off?")
        return content


def is_group(path: Path) -> bool:
    """Return whether a path is a directory that holds a zarr group."""
    return (path / GROUP).is_file()


@contextmanager
def open_zarr(path: Path) -> Iterator[ArrayStore]:
    """Give the files of a group. Raises OSError and ValueError for a path that holds none."""
    if path.is_dir():
        if not is_group(path):
            raise ValueError(f"no zarr group of version 2 (it has no file {GROUP}), expected one")
        yield _Directory(path, tuple(sorted(file.parent.name for file in path.glob(f"*/{ARRAY}"))))
        return
    try:
        with tarfile.open(path, "r:") as tar:
            yield _of_tar(tar)
    except tarfile.TarError as error:
        raise ValueError(f"no tar file that can be read ({error}), expected a zarr group in one") from None


def _of_tar(tar: tarfile.TarFile) -> _Tar:
    """Return the outermost group of a tar file. Nothing is extracted to the disk."""
    files = {PurePosixPath(member.name): member for member in tar.getmembers() if member.isreg()}
    groups = [path.parent for path in files if path.name == GROUP]
    if not groups:
        raise ValueError(f"no zarr group of version 2 (no file {GROUP}) in this tar file, expected one")
    group = min(groups, key=lambda path: (len(path.parts), str(path)))
    held = {str(p.relative_to(group)): member for p, member in files.items() if p.is_relative_to(group)}
    suffix = f"/{ARRAY}"
    names = sorted(name.removesuffix(suffix) for name in held if name.endswith(suffix))
    return _Tar(tar, held, tuple(name for name in names if "/" not in name))


def _missing_error(array: str, name: str) -> ValueError:
    return ValueError(f"array {array!r} has no file {name!r}, expected it; a download cut off?")


def _check_size(array: str, name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise ValueError(f"{array}/{name} has {size} bytes, expected at most {LARGEST_FILE}")
