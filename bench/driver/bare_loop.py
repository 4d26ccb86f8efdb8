"""A loop that does nothing at absolute deadlines: what this machine allows, measured beside the driver.

Run: bare_loop.py RATE SECONDS PRIORITY FILE [PORT]. The file gets a row for each cycle: due, begun, done, ns.
With a PORT, each cycle sends the two requests that a driver cannot leave out to the motor on that port and
awaits each reply.
"""

import os
import select
import subprocess
import sys
import time
from array import array
from pathlib import Path

import numpy as np

from rsea_ros.hardware.peer.serial_line import instruction

PATIENCE = 1.0
"""s for a reply."""
ZERO = instruction(1, 3, bytes((0x5C, 0x02, 0, 0)))
SAMPLE = instruction(1, 2, bytes((0x63, 0x02, 15, 0)))
EMPTY = 11
"""Requests to a 54024, and bytes of a reply without parameters."""


class BareLoop:
    """The loop in a process of its own. priority: of SCHED_FIFO, 0: none. port: of a motor, empty: none."""

    def __init__(self, rate: float, seconds: float, folder: Path, priority: int = 0, port: str = "") -> None:
        self._file = folder / f"bare{'_wire' if port else ''}.npy"
        words = [__file__, f"{rate}", f"{seconds}", f"{priority}", str(self._file), port]
        self._process = subprocess.Popen([sys.executable, *words], stdin=subprocess.DEVNULL)

    def cycles(self) -> np.ndarray:
        """Wait for the end of the loop and return due, begun and done of each cycle, shape (n, 3), ns."""
        self._process.wait()
        return np.load(self._file)


def exchange(descriptor: int) -> None:
    """Write a torque of zero and read a sample, as a driver does."""
    for frame, size in ((ZERO, EMPTY), (SAMPLE, EMPTY + 15)):
        os.write(descriptor, frame)
        while size > 0 and select.select((descriptor,), (), (), PATIENCE)[0]:
            size -= len(os.read(descriptor, 4096))


def main() -> None:
    """Run the loop."""
    rate, seconds, priority = (float(word) for word in sys.argv[1:4])
    port = os.open(sys.argv[5], os.O_RDWR | os.O_NOCTTY) if sys.argv[5] else None
    if priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(int(priority)))
    first, cycles = time.monotonic_ns() + 1_000_000, array("q")
    for k in range(int(rate * seconds)):
        due = first + round(k * 1e9 / rate)
        wait = due - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait / 1e9)
        begun = time.monotonic_ns()
        if port is not None:
            exchange(port)
        cycles.extend((due, begun, time.monotonic_ns()))
    np.save(sys.argv[4], np.array(cycles).reshape(-1, 3))


if __name__ == "__main__":
    main()
