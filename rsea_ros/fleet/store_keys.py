"""Keys of a store, and its compaction.

The new file lists those that it replaces; it gets its name before they are removed. A kill in between leaves
rows twice, which every reader of this package counts once, until the next run removes the old files.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from rsea_ros.documents.wording import brief
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.row import COLUMNS, key_of, write_table
from rsea_ros.outputs.new_files import Destination, NewFiles

EXPECTED_FILES = "expected whole Parquet files: remove the damaged one, and the next run makes its rows anew"
_LONGEST = 120
"""Characters of an error of Parquet."""
_COLUMNS = ["recording", "model_version", "settings", "bag", "bytes", "stamp"]


def known_rows(rows: Path) -> tuple[set[str], dict[tuple[str, int, str], str]]:
    """Return the keys of all rows, and the recording of every bag by path, bytes and stamp."""
    keys: set[str] = set()
    recordings: dict[tuple[str, int, str], str] = {}
    for file in rows.glob("joint=*/month=*/*.parquet"):
        joint = file.parent.parent.name.removeprefix("joint=")
        for row in read(file, _COLUMNS).to_pylist():
            keys.add(key_of({**row, "joint": joint}))
            recordings[row["bag"], row["bytes"], row["stamp"]] = row["recording"]
    return keys, recordings


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


def metadata(file: Path) -> dict[Any, Any]:
    """Return the metadata of a file. Raises FleetError for a damaged file."""
    with _named(file):
        return dict(parquet.read_schema(file).metadata or {})


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Let an error of a damaged file name it."""
    try:
        yield
    except pa.ArrowInvalid as error:
        raise FleetError(f"{file}: {brief(str(error), _LONGEST)}, {EXPECTED_FILES}") from None


_PART = "part-"
_REPLACES = b"rsea.replaces"
_KEY = ("recording", "model_version", "settings")


def compact(folder: Path) -> None:
    """Make one file of a partition's rows, duplicates counted once. Raises OSError."""
    _merge(folder, sorted(folder.glob("*.parquet")))


def compact_loose(folder: Path) -> None:
    """Make one file of a partition's files of one row, and read no other: any number of rows costs the same.

    Raises OSError.
    """
    _merge(folder, sorted(file for file in folder.glob("*.parquet") if not file.name.startswith(_PART)))


def take_out(rows: Path, outcomes: Collection[str]) -> None:
    """Take the rows with some outcomes out of all files. Raises OSError."""
    wanted = pa.array(sorted(outcomes), pa.string())
    for file in sorted(rows.glob("joint=*/month=*/*.parquet")):
        table = read(file)
        kept = table.filter(pc.invert(pc.is_in(table["outcome"], wanted)))
        if kept.num_rows == 0:
            file.unlink()
        elif kept.num_rows < table.num_rows:
            plain = kept.replace_schema_metadata(
                {key: value for key, value in (kept.schema.metadata or {}).items() if key != _REPLACES}
            )  # the row that comes in a removed one's place may have the name of a file that is replaced
            with NewFiles(Destination(file.parent, force=True)) as new:
                write_table(plain, new.stage(file.name))


def finish(rows: Path) -> None:
    """Remove the files that killed compactions have replaced but not removed. Raises OSError."""
    for folder in rows.glob("joint=*/month=*"):
        for part in folder.glob(f"{_PART}*.parquet"):
            _remove(folder, json.loads(metadata(part).get(_REPLACES, b"[]")))


def _merge(folder: Path, files: Sequence[Path]) -> None:
    """Make one file of some files of a partition."""
    if len(files) > 1:
        tables = [read(file) for file in files]
        _replace(folder, files, _once(pa.concat_tables(tables, promote_options="default")))


def _replace(folder: Path, files: Sequence[Path], table: pa.Table) -> None:
    """Give a table the place of some files."""
    names = [file.name for file in files]
    digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]
    marked = table.replace_schema_metadata({**(table.schema.metadata or {}), _REPLACES: json.dumps(names)})
    with NewFiles(folder) as new:
        write_table(marked, new.stage(f"{_PART}{digest}.parquet"))
    _remove(folder, names)


def _remove(folder: Path, names: Sequence[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)


def _once(table: pa.Table) -> pa.Table:
    """Return the rows by time, of those with one key the newest only."""
    seen: set[tuple[str, ...]] = set()
    kept = []
    keys = list(zip(*(table[name].to_pylist() for name in _KEY), strict=True))
    for place in pc.sort_indices(table, [("written", "descending")]).to_pylist():
        if keys[place] not in seen:
            seen.add(keys[place])
            kept.append(place)
    return table.take(pa.array(kept, pa.int64())).sort_by([("time", "ascending"), ("recording", "ascending")])
