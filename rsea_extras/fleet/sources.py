"""Where recordings are: folders, patterns, lists and URLs, all through fsspec."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from fsspec.core import url_to_fs
from fsspec.implementations.local import LocalFileSystem

from rsea_extras.fleet import FleetError
from rsea_extras.fleet.joints import MappedJoint

METADATA = "metadata.yaml"
"""The file that makes a folder one bag."""
_BAGS = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
_BLOCK = 1 << 20
_DIGITS = 16
_LIST = "@"
_MARKS = ("size", "mtime", "ETag", "etag", "LastModified", "updated", "created")
"""What file systems call the size, the time or the tag by which they distinguish contents."""


@dataclass(frozen=True)
class Bag:
    """A recording: its path or URL, its bytes, and a stamp that another content would change."""

    url: str
    size: int
    stamp: str


def bags_of(
    sources: Iterable[str], joints: Sequence[MappedJoint]
) -> list[tuple[Bag, tuple[MappedJoint, ...]]]:
    """Return every recording under some sources with the joints that it holds, by path, each once.

    sources: folders, files, patterns with `*`, URLs, or `@FILE`, a list with a source a line. Recordings that
    hold no joint come with none. Raises FleetError for a source that does not exist or cannot be listed.
    """
    files: dict[str, Mapping[str, Any]] = {}
    for source in _each(sources):
        files |= _files(source)
    tables = [joint for joint in joints if joint.table is not None]
    others = [joint for joint in joints if joint.table is None]
    bags = [(bag, tuple(j for j in others if j.is_in(bag.url))) for bag in _bags(files)]
    if tables:
        placed = ((bag, tuple(j for j in tables if j.is_in(bag.url))) for bag in _all(files))
        bags += [(bag, held) for bag, held in placed if held]
    return sorted(bags, key=lambda item: item[0].url)


def relist(bag: Bag) -> Bag:
    """Return a recording with its present size and stamp. Raises FleetError where it is gone."""
    return _bag(bag.url, _parts(bag.url))


def fingerprint(bag: Bag) -> str:
    """Return the hash of a recording's content: 16 hexadecimal digits of its SHA-256.

    Of a folder that of its files in the order of their names. Raises FleetError where it cannot be read.
    """
    whole = hashlib.sha256()
    for path in sorted(_parts(bag.url)):
        files, inner = _file_system(path)
        try:
            with files.open(inner, "rb") as file:
                while block := file.read(_BLOCK):
                    whole.update(block)
        except OSError as error:
            raise FleetError(f"{path}: {error.strerror or error}") from None
    return whole.hexdigest()[:_DIGITS]


@contextmanager
def local_copy(bag: Bag) -> Iterator[Path]:
    """Give the path of a recording on this machine; that of a copy, for the block, where it is elsewhere."""
    files, inner = _file_system(bag.url)
    if isinstance(files, LocalFileSystem):
        yield Path(inner)
        return
    with TemporaryDirectory(prefix="rsea-fleet-") as folder:
        copy = Path(folder) / PurePosixPath(inner).name
        try:
            files.get(inner, str(copy), recursive=files.isdir(inner))
        except OSError as error:
            raise FleetError(f"{bag.url}: {error.strerror or error}") from None
        yield copy


def _each(sources: Iterable[str]) -> Iterator[str]:
    """Yield the sources, those of lists included. Blank lines and lines that begin with # are left out."""
    for source in sources:
        if not source.startswith(_LIST):
            yield source
            continue
        try:
            lines = Path(source[1:]).read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            why = error.strerror if isinstance(error, OSError) else "not UTF-8"
            raise FleetError(f"{source[1:]}: {why}, expected a list with a source a line") from None
        yield from (line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#"))


def _file_system(url: str) -> tuple[Any, str]:
    try:
        files, inner = url_to_fs(url)
    except (ValueError, ImportError) as error:
        raise FleetError(f"{url}: {error}") from None
    return files, inner


def _files(source: str) -> dict[str, Mapping[str, Any]]:
    """Return the file system's entry of every file under a source, by path or URL."""
    if "::" in source:
        raise FleetError(f"{source}: a chained URL, expected a folder or one URL: unpack the archive first")
    files, inner = _file_system(source)
    try:
        roots = [inner] if files.exists(inner) else files.glob(inner)
        if not roots:
            raise FleetError(f"{source}: no such file or folder, expected recordings")
        bags: dict[str, Mapping[str, Any]] = {}
        for root in roots:
            bags |= files.find(root, detail=True)
    except OSError as error:
        raise FleetError(f"{source}: {error.strerror or error}") from None
    shown = {path: info for path, info in bags.items() if not PurePosixPath(path).name.startswith(".")}
    if isinstance(files, LocalFileSystem):
        return shown
    return {files.unstrip_protocol(path): info for path, info in shown.items()}


def _parts(url: str) -> dict[str, Mapping[str, Any]]:
    """Return the files of one recording: itself, or those directly in its folder."""
    return {path: info for path, info in _files(url).items() if url in (path, _parent(path))}


def _bags(files: Mapping[str, Mapping[str, Any]]) -> Iterator[Bag]:
    """Return folders with metadata as one bag each, and every other file of a bag's kind as another."""
    marked = {_parent(path) for path in files if path.endswith(f"/{METADATA}")}
    wanted = marked | {path for path in files if path.endswith(_BAGS) and _parent(path) not in marked}
    return (bag for bag in _all(files) if bag.url in wanted)


def _all(files: Mapping[str, Mapping[str, Any]]) -> Iterator[Bag]:
    """Yield every file, and every folder that holds files."""
    folders: dict[str, dict[str, Mapping[str, Any]]] = {}
    for path, info in files.items():
        folders.setdefault(_parent(path), {})[path] = info
        yield _bag(path, {path: info})
    for folder, held in folders.items():
        yield _bag(folder, held)


def _bag(url: str, files: Mapping[str, Mapping[str, Any]]) -> Bag:
    marks = {path: " ".join(str(info.get(name)) for name in _MARKS) for path, info in sorted(files.items())}
    stamps = "".join(f"{path}={mark};" for path, mark in marks.items())
    stamp = hashlib.sha256(stamps.encode("utf-8", "surrogateescape")).hexdigest()[:_DIGITS]
    return Bag(url, sum(int(info.get("size") or 0) for info in files.values()), stamp)


def _parent(path: str) -> str:
    return path.rpartition("/")[0]
