"""Cost of a run: equal rows, speed-up, overhead, memory of the scheduler and of a task."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pyarrow as pa

from bench import ROOT
from bench.fleet import stub
from bench.fleet.real import make_fleet, run_real
from rsea_ros.fleet.pool import on_this_machine
from rsea_ros.fleet.row import VARYING, read
from rsea_ros.fleet.store import Store, open_store

MEMORY = 4_000_000_000
MEGA = 1e6
LENGTHS = (10.0, 120.0, 600.0)
"""s of recordings at 280 Hz whose memory is measured."""
FLAT = 0.02
"""Share by which memory may grow over 10 000 tasks: the keys of rows take 0.2 kB each, 0.7 %."""


def line(name: str, asked: str, measured: str, good: bool = True) -> bool:
    """Print a figure beside the required one."""
    print(f"{name:<30} {measured:<60} asked: {asked}{'' if good else '  NOT REACHED'}", flush=True)
    return good


def content(store: Store) -> list[dict[str, object]]:
    """Return the rows in a fixed order, without the columns that may differ from run to run."""
    tables = [read(file) for file in store.rows.glob("joint=*/month=*/*.parquet")]
    rows = pa.concat_tables(tables).drop_columns(list(VARYING)).to_pylist()
    return sorted(rows, key=lambda row: row["recording"])


def real() -> bool:
    """Real recordings serially, on one worker and on two: equal rows, speed-up, overhead."""
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        root = Path(folder)
        bags = make_fleet(root / "bags", int(os.environ.get("BENCH_BAGS", "40")), seconds=60.0)
        warm = open_store(root / "warm", create=True)
        run_real(warm, make_fleet(root / "one", 1))
        stores, took = {}, {}
        stores[0], took[0] = open_store(root / "serial", create=True), 0.0
        spent: list[float] = []
        busy = time.process_time()
        took[0] = seconds_of(lambda: run_real(stores[0], bags, spent=spent))
        busy = time.process_time() - busy
        for count in (1, 2):
            stores[count] = open_store(root / f"dask{count}", create=True)
            with on_this_machine(count, MEMORY) as workers:
                # some recordings for each worker first, so that none compiles while the clock runs
                warm = open_store(root / f"warm{count}", create=True)
                run_real(warm, make_fleet(root / f"warmers{count}", 4), workers)
                took[count] = seconds_of(partial(run_real, stores[count], bags, workers))
        equal = content(stores[0]) == content(stores[1]) == content(stores[2])
        good = line("rows serial, 1, 2 workers", "bit for bit", "equal" if equal else "DIFFERENT", equal)
        faster = took[1] / took[2]
        said = f"{took[0]:.1f} s serial, {took[1]:.1f} s on one, {took[2]:.1f} s on two: {faster:.2f} ×"
        good &= line("1 → 2 workers", "≥ 1.8 ×", said, faster >= 1.8)
        files = stores[0].rows.rglob("*.parquet")
        work = sum(read(file, ["seconds"])["seconds"].to_numpy().sum() for file in files)
        overhead("overhead, serial, processor", busy, sum(spent))
        return good & overhead("overhead, serial", took[0], work)


def overhead(name: str, took: float, work: float) -> bool:
    """Print the share of a run's time that is not spent in tasks."""
    share = took / work - 1.0
    return line(name, "≤ 5 %", f"{100.0 * share:.1f} % of {work:.1f} s of work", share <= 0.05)


def seconds_of(work: Callable[[], object]) -> float:
    """Return how long some work takes, s."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def scheduler(count: int = 10_000) -> bool:
    """Send stub tasks through an embedded cluster; watch the memory of the process that schedules."""
    count = int(os.environ.get("BENCH_TASKS", count))
    os.environ[stub.TAKES] = "0"
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        bags = stub.make_bags(Path(folder) / "bags", count)
        store = open_store(Path(folder) / "store", create=True)
        held, put = array("d"), store.put

        def watch_run(outcome: object) -> None:
            put(outcome)
            held.append(resident())

        store.put = watch_run  # type: ignore[method-assign]
        with on_this_machine(1, MEMORY) as workers:
            begin = time.process_time()
            took = seconds_of(lambda: stub.run_engine(store, bags, workers, stub.stub_row))
            busy = time.process_time() - begin
            merged = resident()
    both = f"{1e3 * busy / count:.1f} ms of CPU, {1e3 * took / count:.1f} ms in all for each task"
    line("client and scheduler", "–", both)
    curve = ", ".join(f"{b / MEGA:.0f}" for b in held[:: count // 10])
    line("… its memory, MB", "–", f"{curve} after each {count // 10} tasks")
    ends = f"{held[-1] / MEGA:.1f}, {merged / MEGA:.1f} after the merge of all rows"
    line("… at the end, MB", "–", ends)
    later = np.array(held)[count // 5 :]
    slope = float(np.polyfit(np.arange(len(later)), later, 1)[0])
    whole = slope * 1e4 / later[0]
    said = f"{slope / 1e3:.2f} kB a task after the first fifth: {whole:.1%} in 10 000"
    return line("memory of the scheduler", "flat over 10 000 stub tasks: ≤ 2 %", said, whole <= FLAT)


def resident() -> float:
    """Return the memory of this process now, bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return float(pages * resource.getpagesize())


def memory() -> bool:
    """Identify recordings of several lengths, each in a new process: the memory of a worker for each byte."""
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        seen = [_peak(make_fleet(Path(folder) / f"{length:g}", 1, length)) for length in LENGTHS]
    for size, peak in seen:
        line("memory of a task", "–", f"{peak / MEGA:.0f} MB for a recording of {size / MEGA:.1f} MB")
    slope, base = np.polyfit(*np.array(seen, float).T, 1)
    return line("memory of a task", "BASE, FACTOR", f"{base / MEGA:.0f} MB + {slope:.1f} × bytes")


def _peak(bags: Path) -> tuple[int, int]:
    """Return bytes of the one recording of a folder, and bytes of memory that a process took for it."""
    code = "import sys, rsea_ros.cli; from bench.fleet.real import print_peak; print_peak(sys.argv[1])"
    command = [sys.executable, "-c", code, str(bags)]
    size, peak = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    return int(size), int(peak)


ALL = {one.__name__: one for one in (real, scheduler, memory)}


def main(parts: Annotated[tuple[str, ...], ALL] = ()) -> int:
    """Run all, or those named; return the exit status."""
    return int(any([not ALL[name]() for name in parts or ALL]))  # noqa: C419 all of them are run
