"""The store of a fleet: a folder of Parquet files, with the artefacts beside them.

    store.json                                   marks the folder as a store
    rows/joint=NAME/month=YYYY-MM/*.parquet      one row a file, or many after compaction
    artefacts/NAME/RECORDING-ANALYSIS/           identification.json, diagnosis.json, …
    alarms/                                      alarms that `rsea fleet watch` has reported

One run at a time writes (see hold_lock); readers need no lock. A file gets its name when it is complete.

The column `joint` is in the path of the file (joint=NAME/month=YYYY-MM), as every reader of partitioned
Parquet expects; its month is that of `time`, in UTC, or `unknown`.

A compacted file lists those that it replaces; it gets its name before they are removed. A kill in between
leaves rows twice, which every reader of this package counts once, until the next run removes the old files.
"""

import fcntl
import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from rsea_extras.fleet import FleetError
from rsea_ros.extension.base import Destination, NewFiles, brief, make_folder, write_file

SCHEMA = 1
"""Grows when a column changes its meaning; a store of a higher one is not read."""
Row = dict[str, Any]


def _list_of(*fields: tuple[str, pa.DataType]) -> pa.DataType:
    return pa.list_(pa.struct([pa.field(name, kind) for name, kind in fields]))


_TEXT, _NUMBER = pa.string(), pa.float64()
_INTERVAL = (("name", _TEXT), ("value", _NUMBER), ("low", _NUMBER), ("high", _NUMBER), ("unit", _TEXT))
_CAUSE = (("name", _TEXT), ("status", _TEXT), ("probability", _NUMBER), ("gain", _NUMBER),
          ("sizes", _list_of(*_INTERVAL)))  # fmt: skip
COLUMNS: Mapping[str, pa.DataType] = {
    "recording": _TEXT,
    "bag": _TEXT,
    "time": pa.timestamp("us", tz="UTC"),
    "duration": _NUMBER,
    "temperature": _NUMBER,
    "excitation": _list_of(("name", _TEXT), ("value", _NUMBER), ("unit", _TEXT)),
    "faults": _list_of(("kind", _TEXT), ("count", pa.int64()), ("detail", _TEXT)),
    "outcome": _TEXT,
    "reason": _TEXT,
    "verdict": _TEXT,
    "diagnosis": _TEXT,
    "parameters": _list_of(*_INTERVAL, ("identifiable", pa.bool_())),
    "causes": _list_of(*_CAUSE),
    "residual": _NUMBER,
    "model_version": _TEXT,
    "settings": _TEXT,
    "schema": pa.int32(),
    "seconds": _NUMBER,
    "peak_memory": pa.int64(),
    "artefacts": _TEXT,
    "bytes": pa.int64(),
    "stamp": _TEXT,
    "written": pa.timestamp("us", tz="UTC"),
}
"""`joint` comes first, by the path. bytes, stamp: of the recording's files when it was read."""
ARROW = pa.schema([pa.field(name, kind) for name, kind in COLUMNS.items()], {"rsea.schema": str(SCHEMA)})


def empty(joint: str, **stated: Any) -> Row:
    """Return a row of which only some columns are known."""
    lists: Row = {name: [] for name, kind in COLUMNS.items() if pa.types.is_list(kind)}
    texts = {name: "" for name, kind in COLUMNS.items() if kind == _TEXT}
    return {"joint": joint, **dict.fromkeys(COLUMNS), **lists, **texts, "schema": SCHEMA, **stated}


def analysis_of(model_version: str, settings: str) -> str:
    """Return the hash of software and settings of a row: 8 hexadecimal digits."""
    return hashlib.sha256(f"{model_version} {settings}".encode()).hexdigest()[:8]


def key_of(joint: str, recording: str, model_version: str, settings: str) -> str:
    """Return the unique key of a row: joint, recording, and hash of software and settings."""
    return f"{joint}/{recording}-{analysis_of(model_version, settings)}"


def write(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write rows of one partition as a Parquet file. Raises OSError."""
    parquet.write_table(pa.Table.from_pylist(rows, schema=ARROW), path, compression=_COMPRESSION)


EXPECTED_FILES = "expected whole Parquet files: remove the damaged one, and the next run makes its rows anew"
_LONGEST, _COMPRESSION = 120, "zstd"
"""Characters of an error of Parquet; how its columns are compressed."""


def read(file: Path, columns: list[str] | None = None) -> pa.Table:
    """Return some columns of one file, all by default, without those in its path.

    Columns that an earlier version did not write are null. Raises FleetError for a damaged file.
    """
    with _named(file), parquet.ParquetFile(file) as opened:
        table = opened.read(columns=columns)
    for name in columns or COLUMNS:
        if name not in table.column_names:
            table = table.append_column(name, pa.nulls(len(table), COLUMNS[name]))
    return table


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Let an error of a damaged file name it."""
    try:
        yield
    except pa.ArrowInvalid as error:
        raise FleetError(f"{file}: {brief(str(error), _LONGEST)}, {EXPECTED_FILES}") from None


_PART = "part-"
_REPLACES = b"rsea.replaces"
_KEY = ["recording", "model_version", "settings"]


def compact(folder: Path, *, loose: bool = False) -> None:
    """Make one file of a partition's rows, duplicates counted once. Raises OSError.

    loose: of the files of one row alone, and read no other: any number of rows costs the same.
    """
    every = sorted(folder.glob("*.parquet"))
    files = [file for file in every if not (loose and file.name.startswith(_PART))]
    if len(files) < 2:
        return
    table = _once(pa.concat_tables([read(file) for file in files], promote_options="default"))
    names = [file.name for file in files]
    digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]
    marked = table.replace_schema_metadata({**(table.schema.metadata or {}), _REPLACES: json.dumps(names)})
    with NewFiles(folder) as new:
        parquet.write_table(marked, new.stage(f"{_PART}{digest}.parquet"), compression=_COMPRESSION)
    _remove(folder, names)


def _take_out(file: Path, outcomes: Collection[str]) -> None:
    table = read(file)
    kept = table.filter(pc.invert(pc.is_in(table["outcome"], pa.array(sorted(outcomes), pa.string()))))
    if kept.num_rows == 0:
        file.unlink()
    elif kept.num_rows < table.num_rows:
        plain = kept.replace_schema_metadata(
            {key: value for key, value in (kept.schema.metadata or {}).items() if key != _REPLACES}
        )  # the row that comes in a removed one's place may have the name of a file that is replaced
        with NewFiles(Destination(file.parent, force=True)) as new:
            parquet.write_table(plain, new.stage(file.name), compression=_COMPRESSION)


def finish(folder: Path) -> None:
    """Remove the files of a partition that a killed compaction has replaced.

    Raises OSError, and FleetError for a damaged file.
    """
    for part in folder.glob(f"{_PART}*.parquet"):
        with _named(part):
            marks = parquet.read_schema(part).metadata or {}
        _remove(folder, json.loads(marks.get(_REPLACES, b"[]")))


def _remove(folder: Path, names: Sequence[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)


def _once(table: pa.Table) -> pa.Table:
    """Return the rows by time, of those with one key the newest only."""
    newest = table.sort_by([("written", "descending")])
    keys = newest.select(_KEY).append_column("place", pa.array(range(len(newest)), pa.int64()))
    kept = keys.group_by(_KEY, use_threads=False).aggregate([("place", "first")])["place_first"]
    return newest.take(kept).sort_by([("time", "ascending"), ("recording", "ascending")])


MARK = "store.json"
LOCK = ".lock"
_COLUMNS = ["recording", "model_version", "settings", "bag", "bytes", "stamp"]
LOOSE = 64
"""Files of one row in a partition from which they become one file: each costs a reader a millisecond."""


@dataclass(frozen=True)
class TaskOutcome:
    """The outcome of a task: its row, and the texts of its artefacts by file name."""

    row: Row
    files: Mapping[str, str] = field(default_factory=dict)


@dataclass
class Store:
    """A store that this process may write to while it holds the lock."""

    path: Path
    _loose: Counter[Path] = field(default_factory=Counter)

    @property
    def rows(self) -> Path:
        return self.path / "rows"

    def known_rows(self) -> tuple[set[str], dict[tuple[str, int, str], str]]:
        """Return the keys of all rows, and the recording of every bag by path, bytes and stamp."""
        keys: set[str] = set()
        recordings: dict[tuple[str, int, str], str] = {}
        for file in self._files():
            joint = file.parent.parent.name.removeprefix("joint=")
            for row in read(file, _COLUMNS).to_pylist():
                keys.add(key_of(joint, row["recording"], row["model_version"], row["settings"]))
                recordings[row["bag"], row["bytes"], row["stamp"]] = row["recording"]
        return keys, recordings

    def _files(self) -> list[Path]:
        return sorted(self.rows.glob("joint=*/month=*/*.parquet"))

    def put(self, outcome: TaskOutcome) -> None:
        """Write artefacts, then the row: a killed writer leaves artefacts without a row, never the reverse.

        Raises OSError, and OutputError for a row that the store has.
        """
        row = {**outcome.row, "written": datetime.now(timezone.utc)}
        analysis = analysis_of(row["model_version"], row["settings"])
        name = f"{row['recording']}-{analysis}"
        if outcome.files:
            row["artefacts"] = f"artefacts/{row['joint']}/{name}"
            with NewFiles(Destination(self.path / row["artefacts"], force=True)) as new:
                for file, content in outcome.files.items():
                    new.write(file, content)
        month = row["time"].astimezone(timezone.utc).strftime("%Y-%m") if row["time"] else "unknown"
        folder = self.rows / f"joint={row['joint']}" / f"month={month}"
        with NewFiles(folder) as new:
            write([row], new.stage(f"{name}.parquet"))
        self._loose[folder] += 1
        if self._loose[folder] >= LOOSE:
            self._loose[folder] = 0
            compact(folder, loose=True)

    def finish(self) -> None:
        """Complete or remove what a killed writer has left."""
        for folder in self.rows.glob("joint=*/month=*"):
            finish(folder)

    def take_out(self, outcomes: Collection[str]) -> None:
        """Take the rows with some outcomes out, so that their recordings count as new."""
        for file in self._files():
            _take_out(file, outcomes)

    def compact(self) -> None:
        for folder in sorted(self.rows.glob("joint=*/month=*")):
            compact(folder)


def open_store(path: str | Path, *, create: bool = False) -> Store:
    """Return a store. create: make a new one if necessary.

    Raises FleetError for a folder that is not a store, or whose schema is unknown.
    """
    store = Store(Path(path))
    mark = store.path / MARK
    if create and not mark.exists():
        if store.path.exists() and (not store.path.is_dir() or any(store.path.iterdir())):
            raise FleetError(f"{path}: not empty and no store, expected a store or a new name")
        make_folder(store.path)
        try:
            write_file(mark, json.dumps({"about": "rsea fleet", "schema": SCHEMA}) + "\n")
        except OSError:  # another run may have written it in the meantime
            if not mark.exists():
                raise
    try:
        schema = json.loads(mark.read_text(encoding="utf-8"))["schema"]
    except OSError:
        raise FleetError(f"{path}: no {MARK} in it, expected a store that rsea fleet run has made") from None
    except (ValueError, KeyError, TypeError):
        raise FleetError(f"{mark}: cannot be read, expected the mark of a store") from None
    if schema not in range(1, SCHEMA + 1):
        raise FleetError(f"{mark}: schema {schema}, expected {SCHEMA}: another version made this store")
    make_folder(store.rows)
    return store


@contextmanager
def hold_lock(store: Store, waiting: Callable[[str], None] | None) -> Iterator[None]:
    """Hold the store's lock; the system releases it when this process ends in any way.

    waiting: called once with the holder; the block begins when that run has ended. None: do not wait.
    Raises FleetError where another run holds it and `waiting` is None.
    """
    lock = os.open(store.path / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(lock, 200, 0).decode(errors="replace").strip() or "another run"
            if waiting is None:
                raise FleetError(f"{store.path}: {holder} writes to it, expected one run at a time") from None
            waiting(holder)
            fcntl.flock(lock, fcntl.LOCK_EX)
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"process {os.getpid()} on {os.uname().nodename}\n".encode(), 0)
        yield
    finally:
        os.close(lock)
