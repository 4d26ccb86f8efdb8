"""Files on the disk: written new, synchronised, and named together or not at all.

A file gets its name by a hard link, which fails where the name is taken: two runs at once cannot take the
same name, no file is replaced unless requested, and no symbolic link is followed.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path

from rsea_ros.errors import OutputError
from rsea_ros.outputs.replaced import Replaced, putting_aside
from rsea_ros.processes import hold_signals

NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EMLINK, errno.ENOSYS}
"""What a file system without hard links says (FAT, some network mounts)."""
NO_SYNC = {errno.EINVAL, errno.ENOTSUP}
"""What a file system says that has no fsync for folders."""
Undo = list[Callable[[], object]]


def make_folder(folder: Path) -> list[Path]:
    """Make a folder and its missing parents; return the folders made, the deepest first."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(made):
        path.mkdir(exist_ok=True)
    return made


def create(path: Path) -> int:
    """Return the descriptor of a new file.

    Raises FileExistsError where anything has the name, also a symbolic link.
    """
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)


def write_at(descriptor: int, data: bytes, offset: int = 0) -> None:
    """Write all of the data."""
    rest = memoryview(data)
    while rest:
        done = os.pwrite(descriptor, rest, offset)
        rest, offset = rest[done:], offset + done


def write_new(path: Path, content: str | bytes) -> None:
    """Write a new file, text as UTF-8; bytes of a file name that are not UTF-8 are escaped."""
    data = content if isinstance(content, bytes) else content.encode("utf-8", "backslashreplace")
    with name_errors(path):
        descriptor = create(path)
        try:
            write_at(descriptor, data)
        finally:
            os.close(descriptor)


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    with name_errors(path):
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        except OSError as error:
            if error.errno not in NO_SYNC:
                raise
        finally:
            os.close(descriptor)


def give_names(pairs: Sequence[tuple[Path, Path]], *, force: bool = False) -> None:
    """Give complete files, or folders of files, their names (source, target): all or, on an error, none.

    Both of a pair are on one file system. force: existing names are replaced, a file by a file, a folder by a
    folder. Raises OutputError for a name that is taken, OSError where the system refuses.
    """
    for source, _ in pairs:
        for path in chain(source.iterdir() if source.is_dir() else (), [source]):
            sync(path)
    undo: Undo = []
    with hold_signals(), putting_aside() as replaced:
        try:
            for source, target in pairs:
                with name_errors(target):
                    _take(source, target, replaced if force else None, undo)
            for folder in {target.parent for _, target in pairs}:
                sync(folder)
            given_up = replaced.give_up()
        except BaseException:
            for step in reversed(undo):
                with suppress(OSError):
                    step()
            raise
        for path in given_up:
            remove(path)


def taken_error(path: Path) -> OutputError:
    """Return the error of a name that is taken."""
    return OutputError(f"{path}: exists already, expected a new name")


def check_replaceable(path: Path) -> None:
    """Raise OutputError for anything that must not be replaced: a device, a pipe, a symbolic link."""
    if path.is_symlink() or not (path.is_file() or path.is_dir()):
        raise OutputError(f"{path}: is not a regular file, expected a new name")


def remove(path: Path) -> None:
    """Remove a file or a folder, if it can be removed."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    with suppress(OSError):
        path.unlink()


def _take(source: Path, target: Path, replaced: Replaced | None, undo: Undo) -> None:
    """Give one file or folder its name.

    replaced: where the present holder of the name is put; None: it stays.
    """
    if replaced is not None and os.path.lexists(target):
        check_replaceable(target)
        if source.is_dir() != target.is_dir():
            kind = "folder" if source.is_dir() else "file"
            raise OutputError(f"{target}: is no {kind}, expected a new name")
        _exchange(source, target, replaced.place(target), undo)
        return
    try:
        _take_free(source, target, undo)
    except FileExistsError:
        raise taken_error(target) from None


def _take_free(source: Path, target: Path, undo: Undo) -> None:
    """Give a file or folder its name, or raise FileExistsError."""
    if source.is_dir():
        target.mkdir()  # takes the name, or fails; a rename may replace this empty folder
        undo.append(target.rmdir)
        os.rename(source, target)
        undo[-1] = lambda: os.rename(target, source)
    elif _link(source, target):
        undo.append(target.unlink)
    else:
        os.close(create(target))  # takes the name, or fails
        undo.append(target.unlink)
        os.rename(source, target)


def _exchange(source: Path, target: Path, aside: Path, undo: Undo) -> None:
    """Put a file or folder in the place of another, which goes aside."""
    if source.is_dir():
        os.rename(target, aside)
        undo.append(lambda: os.rename(aside, target))
        os.rename(source, target)
        undo.append(lambda: os.rename(target, source))
        return
    if _link(target, aside):
        undo.append(aside.unlink)
    else:
        os.rename(target, aside)
        undo.append(lambda: os.rename(aside, target))
    sync(aside.parent)
    os.rename(source, target)
    undo[-1] = lambda: os.rename(aside, target)


def _link(source: Path, target: Path) -> bool:
    """Give a file one more name; return whether the file system can. Raises FileExistsError."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError as error:
        if error.errno in NO_LINKS:
            return False
        raise
    return True


@contextmanager
def name_errors(path: Path) -> Iterator[None]:
    """Put the path into an error of the system, which does not know it once the file is open."""
    try:
        yield
    except OSError as error:
        if error.errno is not None:  # else it is an error of ours, with its whole message
            error.filename = str(path)
        raise
