"""Results as files, all or nothing: written into a stage beside their place, then named together.

They are written into a folder of a random name beside their destination (see staging), and get their names
when all are complete and on the disk. An earlier error or signal changes nothing.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rsea_ros.errors import OutputError, RseaError
from rsea_ros.outputs import files
from rsea_ros.processes import hold_signals


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
        self._stage: files.LockedFolder | None = None

    def __enter__(self) -> NewFiles:
        try:
            with hold_signals():
                self.folder = self._make_folder()
                with files.name_errors(self.folder):
                    self._stage = files.make_stage(self.folder)
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
        files.write_new(self.stage(name), content)
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
                    files.give_names(pairs, force=self._place.force)
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
        self._made = files.make_folder(first.parent if fresh else first)
        for folder in files.siblings(first) if fresh else ():
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
    with files.name_errors(Path(path)):
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
        files.put_back(folder)
    for path in paths:
        for one in map(Path, inputs):
            if one.exists() and _touches(path, one):
                raise OutputError(f"{path}: is the input {one} or lies in it, expected another name")
        if os.path.lexists(path):
            if not force:
                raise OutputError(f"{files.taken_error(path)}{'' if force is None else ' or --force'}")
            files.check_replaceable(path)


def _touches(path: Path, one: Path) -> bool:
    """Return whether a path is an input, by any name, or lies in it."""
    whole, place = one.resolve(), path.resolve()
    return whole in (place, *place.parents) or (path.exists() and path.samefile(one))
