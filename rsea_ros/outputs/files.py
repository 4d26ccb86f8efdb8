"""Results as files: written into a stage beside their place, synchronised, named together or not at all.

They are written into a folder of a random name beside their destination, and get their names when all are
complete and on the disk. An earlier error or signal changes nothing. A file gets its name by a hard link,
which fails where the name is taken: two runs at once cannot take the same name, no file is replaced unless
requested, and no symbolic link is followed. What lasts only while a result is written lies in locked folders
beside it: a stage with what is new, one of kind `old` with what that replaces. The system releases a lock
when its process ends, in any way; so the next writer recognises the folders of a killed one, gives what it
put aside its names back, and removes its stage.
"""

from __future__ import annotations

import errno
import fcntl
import os
import secrets
import shutil
import time
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from types import TracebackType

from rsea_ros.errors import OutputError, RseaError
from rsea_ros.processes import hold_signals

PREFIX, STAGE, OLD = ".rsea-", "stage", "old"
"""Of names that last only while something is written, and the kinds of folders that have them."""
LEFT_AFTER = 60.0
"""s, after which a folder without a lock is one that was left; a new one has its lock within milliseconds."""
_HOST = f"{zlib.crc32(os.uname().nodename.encode()):08x}"
"""Another machine's lock cannot be seen on every network mount: its folders are its own to remove."""
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EMLINK, errno.ENOSYS}
"""What a file system without hard links says (FAT, some network mounts)."""
NO_SYNC = {errno.EINVAL, errno.ENOTSUP}
"""What a file system says that has no fsync for folders."""


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
    undo: list[Callable[[], object]] = []
    aside: dict[Path, LockedFolder] = {}
    with hold_signals():
        try:
            for source, target in pairs:
                with name_errors(target):
                    if force and os.path.lexists(target):
                        _exchange(source, target, aside, undo)
                    else:
                        _take(source, target, undo)
            for folder in {target.parent for _, target in pairs}:
                sync(folder)
            given_up = [new_name(parent, STAGE) for parent in aside]
            for old, path in zip(aside.values(), given_up, strict=True):
                os.rename(old.path, path)
        except BaseException:
            for step in reversed(undo):
                with suppress(OSError):
                    step()
            raise
        finally:
            for old in aside.values():
                with suppress(OSError):
                    old.path.rmdir()
                old.release()
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


def _take(source: Path, target: Path, undo: list[Callable[[], object]]) -> None:
    """Give a file or folder its name. Raises OutputError where it is taken."""
    try:
        if source.is_dir():
            target.mkdir()  # takes the name, or fails; a rename may replace this empty folder
            undo.append(target.rmdir)
            os.rename(source, target)
            undo[-1] = lambda: os.rename(target, source)
            return
        linked = _link(source, target)
        if not linked:
            os.close(create(target))  # takes the name, or fails
        undo.append(target.unlink)
        if not linked:
            os.rename(source, target)
    except FileExistsError:
        raise taken_error(target) from None


def _exchange(
    source: Path, target: Path, folders: dict[Path, LockedFolder], undo: list[Callable[[], object]]
) -> None:
    """Put a file or folder in the place of another, which goes aside into the folder of its parent."""
    check_replaceable(target)
    if source.is_dir() != target.is_dir():
        raise OutputError(f"{target}: is no {'folder' if source.is_dir() else 'file'}, expected a new name")
    if target.parent not in folders:
        folders[target.parent] = make_locked(target.parent, OLD)
    aside = folders[target.parent].path / target.name
    if source.is_dir() or not _link(target, aside):
        os.rename(target, aside)
        undo.append(lambda: os.rename(aside, target))
    else:
        undo.append(aside.unlink)
    sync(aside.parent)
    os.rename(source, target)
    if aside.is_dir():
        undo.append(lambda: os.rename(target, source))
    else:
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


@dataclass(frozen=True)
class LockedFolder:
    """A folder for this process alone, with its lock."""

    path: Path
    lock: int

    def release(self) -> None:
        """Release the lock."""
        os.close(self.lock)

    def remove(self) -> None:
        """Remove the folder, if it can be removed."""
        remove(self.path)
        self.release()


def name_of(kind: str) -> str:
    """Return the prefix of the names of this machine's folders of a kind."""
    return f"{PREFIX}{kind}-{_HOST}-"


def new_name(parent: Path, kind: str) -> Path:
    """Return a name in a folder that nobody has."""
    return parent / f"{name_of(kind)}{secrets.token_hex(8)}"


def make_stage(parent: Path, mode: int = 0o700) -> LockedFolder:
    """Make a stage in a folder, after what killed writers left there is cleared up. Raises OSError."""
    put_back(parent)
    remove_left(parent)
    return make_locked(parent, STAGE, mode)


def make_locked(parent: Path, kind: str, mode: int = 0o700) -> LockedFolder:
    """Make a folder of a kind in a folder. Raises OSError."""
    path = new_name(parent, kind)
    path.mkdir(mode)
    try:
        lock = os.open(path, _FOLDER)
    except OSError:
        path.rmdir()
        raise
    with suppress(OSError):  # a file system without locks: its folders never count as left
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return LockedFolder(path, lock)


def abandoned_folders(parent: Path, kind: str) -> Iterator[tuple[Path, float]]:
    """Yield folders of a kind and of this user whose process is gone, and when a name in each last changed.

    Safe for two processes at once, and beside running writers: each is locked meanwhile. Time in s since the
    epoch.
    """
    entries: list[str] = []
    with suppress(OSError):
        entries = [entry.path for entry in os.scandir(parent) if entry.name.startswith(name_of(kind))]
    for entry in entries:
        with suppress(OSError):  # another process has the lock, or it is no folder
            lock = os.open(entry, _FOLDER)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(lock).st_uid == os.geteuid():
                    yield Path(entry), os.fstat(lock).st_mtime
            finally:
                os.close(lock)


def _is_old(changed: float) -> bool:
    """Return whether a folder is too old for one that is only about to get its lock."""
    return time.time() - changed > LEFT_AFTER


def remove_left(parent: Path) -> None:
    """Remove stages of this user in a folder whose process is gone, and that are older than LEFT_AFTER."""
    for path, changed in abandoned_folders(parent, STAGE):
        if _is_old(changed):
            remove(path)


def put_back(parent: Path) -> None:
    """Restore the files that killed writers of this user put aside in a folder.

    A file that has taken the name since is replaced only where it is the killed writer's; else the old one
    gets the first free of NAME.old, NAME.old-2, …
    """
    for path, changed in abandoned_folders(parent, OLD):
        with suppress(OSError):  # a file that cannot be put back stays, and stops nothing
            names = os.listdir(path)
            for name in names:
                _put_back(path / name, parent / name, changed)
            if names or _is_old(changed):
                path.rmdir()


def _put_back(old: Path, target: Path, changed: float) -> None:
    """Give one file or folder its name back. Raises OSError."""
    if os.path.lexists(target) and (
        old.is_dir() or not target.is_file() or target.stat().st_mtime > changed
    ):
        target = unused_path(target.with_name(f"{target.name}.old"))
    if os.path.lexists(target) and old.samefile(target):
        old.unlink()
    else:
        os.rename(old, target)


def siblings(path: Path) -> Iterator[Path]:
    """Yield NAME, NAME-2, NAME-3, …"""
    yield path
    yield from (path.with_name(f"{path.name}-{number}") for number in count(2))


def unused_path(path: Path) -> Path:
    """Return the first of NAME, NAME-2, NAME-3, … that does not exist."""
    return next(one for one in siblings(path) if not os.path.lexists(one))


@dataclass(frozen=True)
class Destination:
    """Where results go.

    force: files that exist may be replaced. fresh: the first of NAME, NAME-2, NAME-3, … that does not exist.
    """

    folder: Path
    force: bool = False
    fresh: bool = False


class NewFiles:
    """Files of one folder that get their names together at the end of the block; on an error none does.

    folder: their final folder; that of a fresh place is known from the beginning of the block.
    Raises OutputError for a name that is taken, OSError where the system refuses; both name the final file.
    """

    def __init__(self, place: Destination | str | Path) -> None:
        self._place = place if isinstance(place, Destination) else Destination(Path(place))
        self.folder = self._place.folder
        self._names: list[str] = []
        self._made: list[Path] = []
        self._stage: LockedFolder | None = None

    def __enter__(self) -> NewFiles:
        try:
            with hold_signals():
                self.folder = self._make_folder()
                with name_errors(self.folder):
                    self._stage = make_stage(self.folder)
        except BaseException:
            self._clear(complete=False)
            raise
        return self

    def stage(self, name: str) -> Path:
        """Return where another writer puts the file that will have this name."""
        assert self._stage is not None
        self._names.append(name)
        return self._stage.path / name

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a file, and return the path that it will have."""
        write_new(self.stage(name), content)
        return self.folder / name

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._stage is not None
        complete = False
        with hold_signals():
            try:
                if error is None:
                    pairs = [(self._stage.path / name, self.folder / name) for name in self._names]
                    give_names(pairs, force=self._place.force)
                    complete = True
            except (OSError, RseaError) as failure:
                error = failure
                raise
            finally:
                if isinstance(error, (OSError, RseaError)):
                    change = str(self._stage.path), str(self.folder)
                    error.args = tuple(a.replace(*change) if isinstance(a, str) else a for a in error.args)
                    if isinstance(error, OSError) and isinstance(error.filename, str):
                        error.filename = error.filename.replace(*change)
                self._clear(complete)

    def _make_folder(self) -> Path:
        """Make the folder and its missing parents, and return it."""
        first, fresh = self._place.folder, self._place.fresh
        if not fresh and (first.is_symlink() or (first.exists() and not first.is_dir())):
            kind = "symbolic link" if first.is_symlink() else "file"
            raise OutputError(f"{first}: is a {kind}, expected a directory or a new name")
        self._made = make_folder(first.parent if fresh else first)
        for folder in siblings(first) if fresh else ():
            with suppress(FileExistsError):
                folder.mkdir()
                self._made.insert(0, folder)
                return folder
        return first

    def _clear(self, complete: bool) -> None:
        """Remove the stage, and the new folders if nothing was written."""
        with hold_signals():
            if self._stage is not None:
                self._stage.remove()
            for folder in () if complete else self._made:
                with suppress(OSError):
                    folder.rmdir()


def write_file(path: str | Path, content: str | bytes, *, force: bool = False) -> Path:
    """Write one file into a folder that exists, and return its path. Raises as NewFiles does."""
    with name_errors(Path(path)):
        Path(path).parent.stat()
    with NewFiles(Destination(Path(path).parent, force)) as new:
        return new.write(Path(path).name, content)


def check_free(
    paths: Iterable[Path], *, force: bool | None = None, inputs: Collection[str | Path] = ()
) -> None:
    """Refuse, before any work, a name that is taken (unless `force`) and one of the inputs (always).

    Files that a killed writer put aside get their names back first.
    force: --force of a verb; None where there is no such option. Raises OutputError.
    """
    paths = list(paths)
    for folder in {path.parent for path in paths}:
        put_back(folder)
    for path in paths:
        for one in map(Path, inputs):
            if one.exists() and _touches(path, one):
                raise OutputError(f"{path}: is the input {one} or lies in it, expected another name")
        if os.path.lexists(path):
            if not force:
                raise OutputError(f"{taken_error(path)}{'' if force is None else ' or --force'}")
            check_replaceable(path)


def _touches(path: Path, one: Path) -> bool:
    """Return whether a path is an input, by any name, or lies in it."""
    whole, place = one.resolve(), path.resolve()
    return whole in (place, *place.parents) or (path.exists() and path.samefile(one))
