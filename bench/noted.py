"""A node in a process, which leaves the times of its work at its end: python noted.py driver|model …

RSEA_BENCH_TIMES names the file of whole numbers, ns.
driver: a row for each cycle: due, begun, sample (middle of the read), published; the last two are 0 where no
reply came in time.
model: a row for each wrench that came alone: when, by the monotonic clock, then wall and CPU time of the
callback to the last publication, and of observer with flag alone.
"""

import atexit
import os
import sys
import time
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from bench.processes import NOTES


def driver(times: array) -> Callable[[], int]:
    """Return the driver's main with a note of its times."""
    from rsea_ros.hardware.device import State
    from rsea_ros.nodes import driver
    from rsea_ros.nodes._bench_topics import BenchTopics

    step, publish = driver.DriverNode._step, BenchTopics.publish

    def noted_step(self: driver.DriverNode, stamp: int) -> None:
        times.extend((stamp, time.monotonic_ns(), 0, 0))
        step(self, stamp)

    def noted_publish(self: BenchTopics, state: State, shift: int = 0) -> None:
        publish(self, state, shift)
        now = time.monotonic_ns()
        times[-2], times[-1] = state.stamp + shift - time.time_ns() + now, now

    driver.DriverNode._step, BenchTopics.publish = noted_step, noted_publish
    return driver.main


def model(times: array) -> Callable[[], int]:
    """Return the model node's main with a note of its times."""
    from rsea_ros.model.observer import Observer
    from rsea_ros.model.pure_torque_error import ErrorFlag
    from rsea_ros.model.torque_band import TorqueBand
    from rsea_ros.nodes import model

    spent, work = [0, 0], model.ModelNode._work

    def note(kind: Any, name: str) -> None:
        original = getattr(kind, name)

        def take(*args: Any, **named: Any) -> Any:
            cpu, wall = time.thread_time_ns(), time.perf_counter_ns()
            result = original(*args, **named)
            spent[0] += time.perf_counter_ns() - wall  # without thread_time_ns, which asks the kernel
            spent[1] += time.thread_time_ns() - cpu
            return result

        setattr(kind, name, take)

    def noted_work(self: model.ModelNode) -> None:
        spent[:], before = [0, 0], self._assess.count
        wall, cpu = time.perf_counter_ns(), time.thread_time_ns()
        work(self)
        cpu, wall = time.thread_time_ns() - cpu, time.perf_counter_ns() - wall
        if self._assess.count == before + 1:
            times.extend((time.monotonic_ns(), wall, cpu, *spent))

    for kind, name in ((Observer, "_take"), (TorqueBand, "take"), (ErrorFlag, "take")):
        note(kind, name)
    model.ModelNode._work = noted_work
    return model.main


def main() -> int:
    """Run a node with a note of its times: no objects, which the garbage collector would look at."""
    noted, columns = {"driver": (driver, 4), "model": (model, 5)}[sys.argv.pop(1)]
    times = array("q")
    atexit.register(lambda: np.save(os.environ[NOTES], np.array(times, dtype=np.int64).reshape(-1, columns)))
    return noted(times)()


if __name__ == "__main__":
    sys.exit(main())
