"""A loop that does nothing at absolute deadlines: what the machine allows, measured beside what is judged.

Run: bare_loop.py RATE SECONDS PRIORITY FILE. The file gets a row for each cycle: due, begun, monotonic ns.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np


class BareLoop:
    """The loop in a process of its own. priority: of SCHED_FIFO, 0 without."""

    def __init__(self, rate: float, seconds: float, folder: Path, priority: int = 0) -> None:
        self._file = folder / "bare.npy"
        words = [__file__, f"{rate}", f"{seconds}", f"{priority}", str(self._file)]
        self._process = subprocess.Popen([sys.executable, *words], stdin=subprocess.DEVNULL)

    def cycles(self) -> np.ndarray:
        """Wait for its end and return due and begun of each cycle, shape (n, 2), ns."""
        self._process.wait()
        return np.load(self._file)


def main() -> None:
    """Run the loop."""
    rate, seconds, priority = (float(word) for word in sys.argv[1:4])
    if priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(int(priority)))
    first, cycles = time.monotonic_ns() + 1_000_000, []
    for k in range(int(rate * seconds)):
        due = first + round(k * 1e9 / rate)
        wait = due - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait / 1e9)
        cycles.append((due, time.monotonic_ns()))
    np.save(sys.argv[4], np.array(cycles))


if __name__ == "__main__":
    main()
