"""Real small recordings and the real work on them, to measure the whole; workers import it."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from msg_adapters import write_record
from rsea_ros.fleet.engine import Engine, RunSummary
from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.fleet.pool import Executor, Serial
from rsea_ros.fleet.sources import bags_of
from rsea_ros.fleet.store import Store, TaskOutcome
from rsea_ros.fleet.task import Task, work
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig, rig_text
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"
RATE = 280.0
SPREAD = 0.05
START_NS = 1_772_000_000_000_000_000
"""2026-02-25."""
WEEK_NS = 7 * 86_400 * 1_000_000_000


def make_fleet(folder: Path, count: int, seconds: float = 30.0) -> Path:
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


def knee() -> MappedJoint:
    """Return the joint of these recordings; a misfit is not diagnosed, so that each takes the same work."""
    return MappedJoint("knee", rig_text(load_rig(RIG)), diagnose="never")


def print_peak(folder: str) -> None:
    """Work through the one recording of a folder and print its bytes and the peak of memory, bytes."""
    ((bag, joints),) = bags_of([folder], [knee()])
    print(bag.size, work(Task(bag, joints[0], "0" * 16, "bench")).row["peak_memory"])


def run_real(
    store: Store, folder: Path, executor: Executor | None = None, cut: str = "",
    spent: list[float] | None = None,
) -> RunSummary:  # fmt: skip
    """Run the engine over real recordings.

    cut: truncate the one with this in its name while it is read. spent: gets the processor time of each task,
    s; of a serial run only.
    """

    def measure_task(task: Task) -> TaskOutcome:
        if cut and cut in task.bag.url:
            os.truncate(task.bag.url, task.bag.size // 2)
        begin = time.process_time()
        outcome = work(task)
        if spent is not None:
            spent.append(time.process_time() - begin)
        return outcome

    held = bags_of([str(folder)], [knee()])
    function = work if not cut and spent is None else measure_task
    return Engine(store, executor or Serial(), function, lambda step, share: None).run(held)
