"""Stub recordings and the stub work on them, to measure the engine alone; workers import it."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from datetime import datetime, timedelta, timezone
from pathlib import Path

from rsea_ros.fleet.engine import Engine, EngineLimits, RunSummary
from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.fleet.pool import Executor
from rsea_ros.fleet.query import answer
from rsea_ros.fleet.sources import bags_of
from rsea_ros.fleet.store import Store, TaskOutcome
from rsea_ros.fleet.task import Task

KNEE = MappedJoint("knee", "name: stub")
TAKES = "BENCH_TASK_S"
"""Environment variable: how long a stub task takes, s."""
PARAMETERS = ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness", "spring.damping")


def make_bags(folder: Path, count: int) -> Path:
    """Make files that pass for bags, each of other content."""
    folder.mkdir(parents=True)
    for number in range(count):
        (folder / f"run{number:05d}.mcap").write_bytes(number.to_bytes(8, "big") * 16)
    return folder


def stub_row(task: Task) -> TaskOutcome:
    """Return a row as wide as a real one."""
    place = int(task.recording, 16)
    time_of = datetime(2026, 1, 1, tzinfo=timezone.utc) + timedelta(minutes=place % 525_600)
    parameters = [
        {"name": name, "value": 1.0 + k, "low": 0.9 + k, "high": 1.1 + k, "unit": "1", "identifiable": True}
        for k, name in enumerate(PARAMETERS)
    ]
    row = task.row(outcome="done", time=time_of, parameters=parameters, seconds=0.0, peak_memory=0)
    return TaskOutcome(row)


def slow(task: Task) -> TaskOutcome:
    """Return a row after a while."""
    time.sleep(float(os.environ.get(TAKES, "0.5")))
    return stub_row(task)


def run_engine(
    store: Store, folder: Path, executor: Executor, work=slow, limits: EngineLimits | None = None
) -> RunSummary:
    """Run the engine over a folder."""
    held = bags_of([str(folder)], [KNEE])
    return Engine(store, executor, work, lambda step, share: None, limits).run(held)


def rows(store: Store) -> tuple[int, int]:
    """Return the number of rows in all files, and of the recordings in them."""
    import pyarrow.dataset

    table = pyarrow.dataset.dataset(store.rows, partitioning="hive", format="parquet").to_table(["recording"])
    return table.num_rows, len(set(table["recording"].to_pylist()))


def outcomes(store: Store) -> dict[str, int]:
    """Return the number of recordings by outcome."""
    return dict(answer(store, "SELECT outcome, count(*) FROM recordings GROUP BY 1 ORDER BY 1")[1])


def wait_for(condition, limit: float) -> None:
    """Wait until a condition holds. Raises TimeoutError."""
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"not so within {limit:g} s")
        time.sleep(0.05)


def count_row_files(store: Store) -> int:
    """Return how many files of rows the store has."""
    with suppress(OSError):
        return len(list(store.rows.glob("joint=*/month=*/*.parquet")))
    return 0
