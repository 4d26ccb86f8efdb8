"""Bags: directories and single files, MCAP or sqlite3, compressed or not."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

from msg_adapters import mcap_file, metadata, sqlite_file
from msg_adapters.compression import ERRORS, unpack_file, unpack_message
from msg_adapters.contents import Contents
from rsea_ros.errors import BagError

SCANNERS: Mapping[str, Callable[[Path, Contents], None]] = {
    ".mcap": mcap_file.scan,
    ".db3": sqlite_file.scan,
}
PACKED = ".zstd"

BagPath = str | Path


def read_contents(paths: BagPath | Sequence[BagPath], wanted: Collection[str] | None = None) -> Contents:
    """Read the serialised messages of one bag, or of several that belong together.

    wanted: topics whose messages are kept, None for all; the types of the others are told all the same.
    Raises BagError for what is missing, unreadable, no bag, or damaged.
    """
    contents = Contents(wanted)
    for path in [Path(paths)] if isinstance(paths, (str, Path)) else map(Path, paths):
        try:
            for file in _files(path, contents):
                _scan(file, contents)
        except PermissionError as error:
            raise BagError(f"{error.filename or path}: no permission to read it") from None
        except OSError as error:
            raise BagError(f"{error.filename or path}: {error.strerror}") from None
    return contents


def iterate(
    paths: BagPath | Sequence[BagPath], wanted: Collection[str] | None = None
) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield (topic, type, log time in ns, serialised message) by log time, known topics or not."""
    rows = [
        (topic, messages.msgtype, log_time, raw)
        for topic, messages in read_contents(paths, wanted).topics.items()
        for log_time, raw in zip(messages.log_times, messages.raw, strict=True)
    ]
    rows.sort(key=lambda row: row[2])
    yield from rows


def _files(path: Path, contents: Contents) -> list[Path]:
    """Return the storage files of a bag: those its metadata name, else those that lie there."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if not path.is_dir():
        return [path]
    files = metadata.files_of(path, contents)
    files = files or sorted(file for file in path.iterdir() if _suffix(file) in SCANNERS)
    if not files:
        raise BagError(f"{path}: no bag, expected a directory with .mcap or .db3 files")
    return files


def _suffix(file: Path) -> str:
    return Path(file.stem).suffix if file.suffix == PACKED else file.suffix


def _scan(file: Path, contents: Contents) -> None:
    if _suffix(file) not in SCANNERS:
        raise BagError(f"{file}: no bag, expected a directory, or a .mcap or .db3 file")
    if file.stat().st_size == 0:
        raise BagError(f"{file}: empty file")
    found = Contents(contents.wanted)
    try:
        with TemporaryDirectory() if file.suffix == PACKED else nullcontext() as directory:
            SCANNERS[_suffix(file)](unpack_file(file, Path(directory)) if directory else file, found)
        for topic, messages in found.topics.items():
            sink = contents.sink(topic, messages.msgtype)
            if sink is not None:
                sink.log_times.extend(messages.log_times)
                sink.raw.extend(map(unpack_message, messages.raw))
    except (*ERRORS, ValueError) as error:
        raise BagError(f"{file}: {error}") from None
    contents.notes.extend(f"{file}: {note}" for note in found.notes)
