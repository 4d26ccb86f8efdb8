"""The row of a recording and a joint, the Parquet files of rows, and their compaction.

The column `joint` is in the path of the file (joint=NAME/month=YYYY-MM), as every reader of partitioned
Parquet expects; its month is that of `time`, in UTC, or `unknown`.

A compacted file lists those that it replaces; it gets its name before they are removed. A kill in between
leaves rows twice, which every reader of this package counts once, until the next run removes the old files.
"""

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rsea_ros.documents.wording import brief
from rsea_ros.fleet import FleetError, need_extra
from rsea_ros.outputs.new_files import Destination, NewFiles

need_extra()  # says in one line what the next ones lack
import pyarrow as pa  # noqa: E402
import pyarrow.compute as pc  # noqa: E402
from pyarrow import parquet  # noqa: E402

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


def take_out(file: Path, outcomes: Collection[str]) -> None:
    """Take the rows with some outcomes out of a file. Raises OSError."""
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
