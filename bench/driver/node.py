"""The driver node in a process, which leaves the times of its cycles and publications at its end.

RSEA_BENCH_TIMES names the file: a row for each cycle, ns: due, begun, sample (middle of the read), published.
The last two are 0 where no reply came in time.
"""

import atexit
import os
import sys
import time
from array import array

import numpy as np

from bench.processes import NOTES
from rsea_ros.hardware.device import State
from rsea_ros.nodes import driver
from rsea_ros.nodes._bench_topics import BenchTopics


def main() -> int:
    """Run the node with a note of its times."""
    times = array("q")  # not objects, which the garbage collector would look at
    step, publish = driver.DriverNode._step, BenchTopics.publish

    def noted_step(self: driver.DriverNode, stamp: int) -> None:
        times.extend((stamp, time.monotonic_ns(), 0, 0))
        step(self, stamp)

    def noted_publish(self: BenchTopics, state: State, shift: int = 0) -> None:
        publish(self, state, shift)
        now = time.monotonic_ns()
        times[-2], times[-1] = state.stamp + shift - time.time_ns() + now, now

    driver.DriverNode._step, BenchTopics.publish = noted_step, noted_publish
    atexit.register(lambda: np.save(os.environ[NOTES], np.array(times).reshape(-1, 4)))
    return driver.main()


if __name__ == "__main__":
    sys.exit(main())
