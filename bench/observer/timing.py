"""The model node in its place: plant, excite and model in processes of their own; this process receives.

Each rate as any process, then at SCHED_FIFO where that is permitted: the model node, and one above it the
plant, which stands for hardware. Beside it, in the same run: the latency of ft to this process, and a bare
loop with absolute deadlines.

`tight` times observer and flag without a node: command, state, ft and flag of one sample. In a tight loop the
caches are warm. After a sleep of a period they are not: that is the machine's share of the node's time.
"""

import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import product
from pathlib import Path

import numpy as np

from bench.driver.reception import beside_bare_loop
from bench.processes import may_have, own_domain, run_node
from bench.results import Row
from msg_adapters.ros import JointState, WrenchStamped
from rsea_ros.model.observer import Observer
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.records.record import FloatArray

SAMPLES, WARM, REPEATS, RATE = 3000, 600, 5, 1000.0


def timing(
    *, rate: tuple[float, ...] = (280.0, 1000.0), priority: tuple[int, ...] = (0, 80), seconds: float = 20.0
) -> Iterator[Row]:
    """Measure each rate with each priority."""
    own_domain()
    for hz, fifo in product(rate, filter(may_have, priority)):
        with tempfile.TemporaryDirectory() as folder:
            yield from _at(hz, fifo, seconds, Path(folder))


def _at(rate: float, priority: int, seconds: float, folder: Path) -> Iterator[Row]:
    work = {"kind": "multisine", "amplitude": 8.0, "high": 40.0, "duration": seconds + 60.0}
    with ExitStack() as nodes:
        nodes.enter_context(run_node("plant", priority=priority and priority + 1, folder=folder, rate=rate))
        model = nodes.enter_context(run_node("model", folder=folder, noted=True, realtime_priority=priority))
        nodes.enter_context(run_node("excite", folder=folder, rate=rate, **work))
        topics = {"torque_estimate": (JointState, COMMAND), "ft": (WrenchStamped, MEASUREMENT)}
        delays, bare, cpu = beside_bare_loop(model.pid, topics, rate, seconds, folder, priority)
    rows = np.load(folder / "model.npy")
    rows = rows[(rows[:, 0] > bare[0, 1]) & (rows[:, 0] < bare[-1, 1])]
    setup = f"{rate:g} Hz" + (f", FIFO {priority}: " if priority else ": ")
    yield _line(setup + "observer and flag, µs", "p99 < 60", rows[:, 3] / 1e3)
    yield _line(setup + "the same, CPU time of the thread, µs", "", rows[:, 4] / 1e3)
    yield _line(setup + "ft callback to torque_estimate published, ms", "p99 < 0.3", rows[:, 1] / 1e6)
    yield _line(setup + "the same, CPU time of the thread, ms", "", rows[:, 2] / 1e6)
    received = delays["torque_estimate"]
    yield _line(setup + "ft stamp to torque_estimate received, ms", "p99 < 1.2 at 1 kHz", received)
    yield _line(setup + "ft stamp to ft itself received, ms", "", delays["ft"])
    lateness = np.abs(np.diff(bare[:, 1]) / 1e6 - 1e3 / rate)
    yield _line(setup + "bare loop, off its period, ms", "", lateness)
    share = f"{100.0 * cpu:.1f} % of a core"
    yield Row(setup + "CPU of the model node", "< 15 % at 280 Hz", share)


def _line(what: str, asked: str, values: FloatArray) -> Row:
    p50, p99 = np.quantile(values, [0.5, 0.99])
    return Row(f"{what}: p50, p99", asked, f"{p50:.3f}, {p99:.3f} of {len(values)}")


def tight() -> Iterator[Row]:
    """Print p50 and p99 of one sample, best of five runs, with stamps on a grid and with jitter of 0.1 ms."""
    for name in ("paper_high_impedance", "two_moving_outputs"):
        for words, jitter in (("on a grid", 0.0), ("jitter 0.1 ms", 1e-4)):
            runs = [_times(load_rig(name), jitter) for _ in range(REPEATS)]
            yield _line(f"{name}, {words}, µs", "", min(runs, key=lambda run: np.quantile(run, 0.99)))
    for rate in (280.0, 1000.0):
        times = _times(load_rig("paper_high_impedance"), 0.0, 1.0 / rate)
        yield _line(f"the first, slept {1e3 / rate:.2g} ms before, µs", "", times)


def _times(rig: Rig, jitter: float, pause: float = 0.0) -> FloatArray:
    observer, band, flag, times = Observer(rig), TorqueBand(rig), ErrorFlag(rig), []
    shifts = jitter * np.random.default_rng(0).uniform(-1.0, 1.0, SAMPLES)
    for k, shift in enumerate(shifts.tolist()):
        time.sleep(pause)
        t, begin = k / RATE + shift, time.perf_counter_ns()
        observer.command((k - 1) / RATE, 1.0)
        observer.state(t, 0.0, 0.0)
        estimate = observer.ft(t, 0.0)
        assert estimate is not None
        flag.take(t, estimate, heard=band.take(t, estimate))
        times.append((time.perf_counter_ns() - begin) / 1e3)
        if k == WARM // 2:
            band.calibrate(observer.error_model(1.0 / RATE), 1.0 / RATE)
    return np.array(times[WARM:])
