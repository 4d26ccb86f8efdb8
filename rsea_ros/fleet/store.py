"""The store of a fleet: a folder of Parquet files, with the artefacts beside them.

    store.json                                   marks the folder as a store
    rows/joint=NAME/month=YYYY-MM/*.parquet      one row a file, or many after compaction
    artefacts/NAME/RECORDING-ANALYSIS/           identification.json, diagnosis.json, …
    alarms/                                      alarms that `rsea fleet watch` has reported

One run at a time writes (see hold_lock); readers need no lock. A file gets its name when it is complete.
"""

import fcntl
import json
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

from rsea_ros.fleet import FleetError, row as of_row
from rsea_ros.fleet.row import SCHEMA, Row, analysis_of, key_of
from rsea_ros.outputs.files import make_folder
from rsea_ros.outputs.new_files import Destination, NewFiles, write_file

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
            for row in of_row.read(file, _COLUMNS).to_pylist():
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
            of_row.write([row], new.stage(f"{name}.parquet"))
        self._loose[folder] += 1
        if self._loose[folder] >= LOOSE:
            self._loose[folder] = 0
            of_row.compact(folder, loose=True)

    def finish(self) -> None:
        """Complete or remove what a killed writer has left."""
        for folder in self.rows.glob("joint=*/month=*"):
            of_row.finish(folder)

    def take_out(self, outcomes: Collection[str]) -> None:
        """Take the rows with some outcomes out, so that their recordings count as new."""
        for file in self._files():
            of_row.take_out(file, outcomes)

    def compact(self) -> None:
        for folder in sorted(self.rows.glob("joint=*/month=*")):
            of_row.compact(folder)


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
