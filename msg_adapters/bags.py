"""Bags of all storages, opened and checked."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from msg_adapters.compression import ERRORS, ZSTD_MAGIC, Allowance, unpack_file, unpack_message
from msg_adapters.contents import AND, METADATA, Contents, Messages, metadata_of
from rsea_ros.documents.wording import brief
from rsea_ros.errors import BagError

SCANNERS = {".mcap": "mcap_file", ".db3": "sqlite_file", ".bag": "ros1_file"}
"""By suffix: the module of this package whose `scan` adds the messages of a file to contents."""
PACKED = ".zstd"
TABLES = (".csv", ".tsv", ".txt", ".dat", ".mat", ".npz", ".npy", ".json", ".parquet", ".pq")
"""Suffixes of files that `rsea import` converts."""

BagPath = str | Path
_MOST_NAMED = 5
"""Files that a message lists."""


def read_contents(paths: BagPath | Sequence[BagPath], wanted: Collection[str] | None = None) -> Contents:
    """Read the serialised messages of one bag, or of several that belong together.

    wanted: topics whose messages are kept, None for all; the types of the others are returned too.
    Raises BagError for files that are missing, unreadable, damaged, or not a bag.
    """
    contents = Contents(wanted)
    parts: list[Contents] = []
    for path in [Path(paths)] if isinstance(paths, (str, Path)) else map(Path, paths):
        try:
            parts += _bag(path, contents)
        except PermissionError as error:
            raise BagError(f"{error.filename or path}: no permission to read it") from None
        except OSError as error:
            raise BagError(f"{error.filename or path}: {error.strerror}") from None
    join(parts, contents)
    return contents


def join(parts: Sequence[Contents], contents: Contents) -> None:
    """Add files to the contents, each topic by the first log time of the files, not by their names."""
    for part in parts:
        for topic, messages in part.topics.items():
            for msgtype in messages.msgtype.split(AND):
                contents.sink(topic, msgtype)
    for topic, whole in contents.topics.items():
        filled = [part.topics[topic] for part in parts if topic in part.topics and part.topics[topic].raw]
        for messages in sorted(filled, key=lambda messages: min(messages.log_times)):
            whole.log_times.extend(messages.log_times)
            whole.raw.extend(messages.raw)


def iterate(paths: BagPath | Sequence[BagPath]) -> Iterator[tuple[str, str, int, bytes]]:
    """Return (topic, type, log time in ns, serialised message) by log time."""
    rows = [
        (topic, messages.msgtype, log_time, raw)
        for topic, messages in read_contents(paths).topics.items()
        for log_time, raw in zip(messages.log_times, messages.raw, strict=True)
    ]
    return iter(sorted(rows, key=lambda row: row[2]))


def _bag(path: Path, contents: Contents) -> list[Contents]:
    """Return the files of a bag, read; notes and faults go to the contents."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if not path.is_dir():
        return [_scan(path, contents)]
    known = metadata_of(path, contents)
    files = known.files or sorted(file for file in path.iterdir() if _suffix(file) in SCANNERS)
    if not files:
        raise BagError(f"{path}: no bag, expected a directory with .mcap, .db3 or .bag files")
    _tell_unnamed(path, files, contents)
    parts = _scan_all(files, contents)
    contents.take(known.remarks)
    for topic, expected in known.counts.items():
        read = sum(len(part.topics[topic].raw) for part in parts if topic in part.topics)
        contents.compare(topic, expected, read, METADATA)
    return parts


def _tell_unnamed(folder: Path, files: Sequence[Path], contents: Contents) -> None:
    """Report the storage files of a folder that are not read because metadata.yaml does not name them."""
    read = ", ".join(file.name for file in files[:_MOST_NAMED])
    for file in sorted(folder.iterdir()):
        if file not in files and _suffix(file) in SCANNERS:
            detail = f"left out: {METADATA} names {read} only; give {brief(file.name)} itself to read it"
            contents.tell("unnamed_file", file.name, detail)


def _scan_all(files: Sequence[Path], contents: Contents) -> list[Contents]:
    """Return the contents of each file. One that cannot be read is left out and reported, if others can."""
    parts = []
    errors = []
    for file in files:
        try:
            parts.append(_scan(file, contents))
        except BagError as error:
            errors.append(error)
            contents.tell("damaged_file", file.name, f"left out: {error}")
    if errors and not parts:
        raise errors[0]
    return parts


def _suffix(file: Path) -> str:
    return Path(file.stem).suffix if file.suffix == PACKED else file.suffix


def _scan(file: Path, contents: Contents) -> Contents:
    """Return the contents of a file; its notes and faults are added to those of the bag."""
    if _suffix(file) not in SCANNERS:
        table = f"; a table becomes a bag by rsea import {file} --map MAP" if _suffix(file) in TABLES else ""
        raise BagError(f"{file}: no bag, expected a directory, or a .mcap, .db3 or .bag file{table}")
    if file.stat().st_size == 0:
        raise BagError(f"{file}: empty file")
    part = Contents(contents.wanted)
    try:
        allowance = Allowance(file.stat().st_size)
        with TemporaryDirectory() if file.suffix == PACKED else nullcontext() as directory:
            plain = unpack_file(file, Path(directory)) if directory else file
            import_module(f"msg_adapters.{SCANNERS[_suffix(file)]}").scan(plain, part, allowance)
        for topic, messages in part.topics.items():
            _unpack(topic, messages, allowance, part)
    except (*ERRORS, ValueError) as error:
        raise BagError(f"{file}: {error}") from None
    contents.notes.extend(f"{file}: {note}" for note in part.notes)
    contents.faults.extend(part.faults)
    return part


def _unpack(topic: str, messages: Messages, allowance: Allowance, contents: Contents) -> None:
    """Decompress messages that are compressed one by one; leave out those that cannot be."""
    if not any(raw.startswith(ZSTD_MAGIC) for raw in messages.raw):
        return
    damaged: list[str] = []
    kept: list[tuple[int, bytes]] = []
    for log_time, raw in zip(messages.log_times, messages.raw, strict=True):
        try:
            kept.append((log_time, unpack_message(raw, allowance)))
        except (*ERRORS, ValueError) as error:
            damaged.append(str(error))
    if damaged:
        share = len(damaged) / len(messages.raw)
        contents.tell("damaged_messages", topic, damaged[0], len(damaged), "messages", share)
    messages.log_times, messages.raw = [t for t, _ in kept], [raw for _, raw in kept]
