"""Cost of a run of `rsea fleet`: speed-up, overhead, memory of the scheduler and of a task."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from bench import ROOT
from bench.results import Row
from msg_adapters import write_record
from rsea_ros.fleet.engine import Engine
from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.fleet.pool import Executor, Serial, on_this_machine
from rsea_ros.fleet.row import read
from rsea_ros.fleet.sources import bags_of
from rsea_ros.fleet.store import Store, TaskOutcome, open_store
from rsea_ros.fleet.task import Task, work
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig, rig_text
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RIG, RATE, SPREAD = "paper_high_impedance", 280.0, 0.05
START_NS, WEEK_NS = 1_772_000_000_000_000_000, 7 * 86_400 * 1_000_000_000
"""2026-02-25."""
MEMORY, MEGA = 4_000_000_000, 1e6
LENGTHS = (10.0, 120.0, 600.0)
"""s of recordings at 280 Hz whose memory is measured."""
PARAMETERS = ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness", "spring.damping")


def make_fleet(folder: Path, count: int, seconds: float = 60.0) -> Path:
    """Make recordings of one bench whose free values scatter a little, one each week."""
    folder.mkdir(parents=True, exist_ok=True)
    rig, rng = load_rig(RIG), np.random.default_rng(1)
    for number in range(count):
        true = rig.with_values({n: rig[n] * (1.0 + SPREAD * rng.uniform(-1.0, 1.0)) for n in rig.free()})
        u = excitation("chirp", ExcitationSettings(rate=RATE, duration=seconds, seed=number))
        record = synthesize(true, Channel(np.arange(len(u)) / RATE, u), seed=number)
        epoch = START_NS + number * WEEK_NS
        write_record(replace(record, epoch_ns=epoch), folder / f"knee-{number:03d}.mcap")
    return folder


def run_fleet(
    store: Store, folder: Path, executor: Executor | None = None, task: Callable[[Task], TaskOutcome] = work
) -> None:
    """Run the engine over a folder; a misfit is not diagnosed, so that each recording takes the same work."""
    knee = MappedJoint("knee", rig_text(load_rig(RIG)), diagnose="never")
    held = bags_of([str(folder)], [knee])
    Engine(store, executor or Serial(), task, lambda step, share: None).run(held)


def real(count: int = 40) -> Iterator[Row]:
    """Run real recordings serially, on one worker and on two: speed-up, overhead."""
    count = int(os.environ.get("BENCH_BAGS", count))
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        root = Path(folder)
        bags = make_fleet(root / "bags", count)
        run_fleet(open_store(root / "warm", create=True), make_fleet(root / "one", 1))
        serial, took, spent = open_store(root / "serial", create=True), {}, list[float]()

        def measured(task: Task) -> TaskOutcome:
            begin = time.process_time()
            done = work(task)
            spent.append(time.process_time() - begin)
            return done

        busy = time.process_time()
        took[0] = seconds_of(lambda: run_fleet(serial, bags, task=measured))
        busy = time.process_time() - busy
        for workers_of in (1, 2):
            store = open_store(root / f"dask{workers_of}", create=True)
            with on_this_machine(workers_of, MEMORY) as workers:
                # some recordings for each worker first, so that none compiles while the clock runs
                warm = open_store(root / f"warm{workers_of}", create=True)
                run_fleet(warm, make_fleet(root / f"warmers{workers_of}", 4), workers)
                took[workers_of] = seconds_of(partial(run_fleet, store, bags, workers))
        told = f"{took[0]:.1f} s serial, {took[1]:.1f} s on one, {took[2]:.1f} s on two"
        yield Row("1 → 2 workers", "≥ 1.8 ×", f"{took[1] / took[2]:.2f} ×: {told}")
        wall = sum(read(f, ["seconds"])["seconds"].to_numpy().sum() for f in serial.rows.rglob("*.parquet"))
        for name, all_of_it, tasks in (("processor", busy, sum(spent)), ("wall", took[0], wall)):
            told = f"{100.0 * (all_of_it / tasks - 1.0):.1f} % of {tasks:.1f} s of work"
            yield Row(f"time that is not spent in tasks, serial, {name}", "≤ 5 %", told)


def seconds_of(run: Callable[[], object]) -> float:
    """Return how long something takes, s."""
    begin = time.perf_counter()
    run()
    return time.perf_counter() - begin


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


def scheduler(count: int = 10_000) -> Iterator[Row]:
    """Send stub tasks through an embedded cluster; watch the memory of the process that schedules."""
    count = int(os.environ.get("BENCH_TASKS", count))
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        bags = Path(folder) / "bags"
        bags.mkdir()
        for number in range(count):
            (bags / f"run{number:05d}.mcap").write_bytes(number.to_bytes(8, "big") * 16)
        store = open_store(Path(folder) / "store", create=True)
        held, put = array("d"), store.put

        def watch_run(outcome: object) -> None:
            put(outcome)
            held.append(resident() / MEGA)

        store.put = watch_run
        with on_this_machine(1, MEMORY) as workers:
            begin = time.process_time()
            took = seconds_of(lambda: run_fleet(store, bags, workers, stub_row))
            busy = time.process_time() - begin
            merged = resident() / MEGA
    told = f"{1e3 * busy / count:.1f} ms of CPU, {1e3 * took / count:.1f} ms in all"
    yield Row("client and scheduler, each task", "", told)
    curve = ", ".join(f"{b:.0f}" for b in held[:: count // 10])
    told = f"{curve} after each {count // 10} tasks, {held[-1]:.1f} at the end, {merged:.1f} after the merge"
    yield Row("their memory, MB", "", told)
    later = np.array(held)[count // 5 :]
    slope = float(np.polyfit(np.arange(len(later)), later, 1)[0])
    told = f"{1e3 * slope:.2f} kB a task: {slope * 1e4 / later[0]:.1%} in 10 000"
    yield Row("its growth after the first fifth", "flat over 10 000 tasks: ≤ 2 %", told)


def resident() -> float:
    """Return the memory of this process now, bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return float(pages * resource.getpagesize())


def memory() -> Iterator[Row]:
    """Identify recordings of several lengths, each in a new process: the memory of a worker for each byte."""
    with tempfile.TemporaryDirectory(prefix="rsea-bench-") as folder:
        seen = [_peak(make_fleet(Path(folder) / f"{length:g}", 1, length)) for length in LENGTHS]
    for size, peak in seen:
        yield Row(f"memory of a task, recording of {size / MEGA:.1f} MB", "", f"{peak / MEGA:.0f} MB")
    slope, base = np.polyfit(*np.array(seen, float).T, 1)
    yield Row("memory of a task", "BASE, FACTOR of the engine", f"{base / MEGA:.0f} MB + {slope:.1f} × bytes")


def _peak(bags: Path) -> tuple[int, int]:
    """Return bytes of the one recording of a folder, and bytes of memory that a process took for it."""
    code = "import sys, rsea_ros.cli; from bench.fleet.cost import print_peak; print_peak(sys.argv[1])"
    command = [sys.executable, "-c", code, str(bags)]
    size, peak = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    return int(size), int(peak)


def print_peak(folder: str) -> None:
    """Work through the one recording of a folder and print its bytes and the peak of memory, bytes."""
    ((bag, joints),) = bags_of([folder], [MappedJoint("knee", rig_text(load_rig(RIG)), diagnose="never")])
    print(bag.size, work(Task(bag, joints[0], "0" * 16, "bench")).row["peak_memory"])


ALL = {one.__name__: one for one in (real, scheduler, memory)}


def main(parts: Annotated[tuple[str, ...], ALL] = ()) -> Iterator[Row]:
    """Run all, or those named."""
    for name in parts or ALL:
        yield from ALL[name]()
