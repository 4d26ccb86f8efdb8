"""The model node in its place: plant, excite and model in processes of their own; this process receives.

Each rate as any process, then at SCHED_FIFO where that is permitted: the model node, and one above it the
plant, which stands for hardware. Beside it, in the same run: the latency of ft to this process, and a bare
loop with absolute deadlines.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from bench import ROOT
from bench.driver.bare_loop import BareLoop, may_have
from bench.driver.reception import Reception
from bench.observer.node import MARK
from bench.processes import cpu_time, own_domain
from msg_adapters.ros import JointState, WrenchStamped
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.records.record import FloatArray

SETTLE = 3.0


def timing(
    *, rate: tuple[float, ...] = (280.0, 1000.0), priority: tuple[int, ...] = (0, 80), seconds: float = 20.0
) -> Iterator[str]:
    """Measure each rate with each priority."""
    own_domain()
    yield f"{'what':58} {'required':18} p50, p99"
    for hz, fifo in product(rate, filter(may_have, priority)):
        with tempfile.TemporaryDirectory() as folder:
            yield from _at(hz, fifo, seconds, Path(folder))


def _at(rate: float, priority: int, seconds: float, folder: Path) -> Iterator[str]:
    times = folder / "times.npy"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(folder), MARK: str(times)}
    nodes = [_start(words, folder, environment) for words in (
        ["-m", "rsea_ros.nodes.plant", "--ros-args", "-p", f"rate:={rate}"],
        [str(ROOT / "bench/observer/node.py"), "--ros-args", "-p", f"realtime_priority:={priority}"],
        ["-m", "rsea_ros.nodes.excite", "--ros-args", "-p", f"rate:={rate}", "-p", "kind:=multisine",
         "-p", "amplitude:=8.0", "-p", "high:=40.0", "-p", f"duration:={seconds + 60.0}"],
    )]  # fmt: skip
    if priority:
        os.sched_setscheduler(nodes[0].pid, os.SCHED_FIFO, os.sched_param(priority + 1))
    try:
        reception = Reception({"torque_estimate": (JointState, COMMAND), "ft": (WrenchStamped, MEASUREMENT)})
        reception.wait("torque_estimate")
        time.sleep(SETTLE)
        reception.forget()
        bare = BareLoop(rate, seconds, folder, priority)
        begin, cpu = time.monotonic_ns(), cpu_time(nodes[1].pid)
        time.sleep(seconds)
        end, cpu = time.monotonic_ns(), cpu_time(nodes[1].pid) - cpu
        estimates, wrenches = reception.delays("torque_estimate"), reception.delays("ft")
        lateness = np.abs(np.diff(bare.cycles()[:, 1]) / 1e6 - 1e3 / rate)
        reception.close()
    finally:
        for node in nodes:
            node.send_signal(signal.SIGINT)
        for node in nodes:
            node.wait()
    rows = np.load(times)
    rows = rows[(rows[:, 0] > begin) & (rows[:, 0] < end)]
    setup = f"{rate:g} Hz" + (f", FIFO {priority}: " if priority else ": ")
    yield from _report(setup, rows, estimates, wrenches, lateness, cpu / seconds)


def _report(
    setup: str, rows: FloatArray, estimates: FloatArray, wrenches: FloatArray, lateness: FloatArray,
    cpu: float,
) -> Iterator[str]:  # fmt: skip
    yield _line(setup + "observer and flag, µs", "p99 < 60", rows[:, 3] / 1e3)
    yield _line(setup + "the same, CPU time of the thread, µs", "", rows[:, 4] / 1e3)
    yield _line(setup + "ft callback to torque_estimate published, ms", "p99 < 0.3", rows[:, 1] / 1e6)
    yield _line(setup + "the same, CPU time of the thread, ms", "", rows[:, 2] / 1e6)
    yield _line(setup + "ft stamp to torque_estimate received, ms", "p99 < 1.2 at 1 kHz", estimates)
    yield _line(setup + "ft stamp to ft itself received, ms", "", wrenches)
    yield _line(setup + "bare loop, off its period, ms", "", lateness)
    yield f"{setup + 'CPU of the model node':58} {'< 15 % at 280 Hz':18} {100.0 * cpu:.1f} % of a core"


def _line(what: str, asked: str, values: FloatArray) -> str:
    p50, p99 = np.quantile(values, [0.5, 0.99])
    return f"{what:58} {asked:18} {p50:.3f}, {p99:.3f}   ({len(values)} values)"


def _start(words: list[str], folder: Path, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    log = (folder / f"{len(list(folder.iterdir()))}.log").open("wb")
    return subprocess.Popen([sys.executable, *words], env=environment, cwd=ROOT, stdin=subprocess.DEVNULL,
                            stdout=log, stderr=log)  # fmt: skip
