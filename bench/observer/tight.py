"""Observer and flag without a node: command, state, ft and flag of one sample.

In a tight loop the caches are warm. After a sleep of a period they are not: that is the machine's share of
the node's time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from rsea_ros.model.observer import Observer
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.records.record import FloatArray

SAMPLES, WARM, REPEATS, RATE = 3000, 600, 5, 1000.0


def tight() -> Iterator[str]:
    """Print p50 and p99 of the best of five runs, with stamps on a grid and with jitter of 0.1 ms."""
    yield f"{'one sample, µs, best of five':34} p50, p99"
    for name in ("paper_high_impedance", "two_moving_outputs"):
        for words, jitter in (("on a grid", 0.0), ("jitter 0.1 ms", 1e-4)):
            runs = [np.quantile(_times(load_rig(name), jitter), [0.5, 0.99]) for _ in range(REPEATS)]
            p50, p99 = min(runs, key=lambda run: run[1])
            yield f"{name + ', ' + words:34} {p50:.0f}, {p99:.0f}"
    for rate in (280.0, 1000.0):
        p50, p99 = np.quantile(_times(load_rig("paper_high_impedance"), 0.0, 1.0 / rate), [0.5, 0.99])
        yield f"{f'the first, slept {1e3 / rate:.2g} ms before':34} {p50:.0f}, {p99:.0f}"


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
