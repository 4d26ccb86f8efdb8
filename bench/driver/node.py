"""The driver node in a process of its own, with the times of its cycles and publications written down."""

from __future__ import annotations

import atexit
import os
import signal
import subprocess
import sys
import time
from array import array
from pathlib import Path

import numpy as np

from bench import ROOT

MARK = "RSEA_BENCH_TIMES"


class Node:
    """A driver in a process."""

    def __init__(self, folder: Path, **parameters: object) -> None:
        self._file = folder / "times.npy"
        words = [w for k, v in parameters.items() for w in ("-p", f"{k}:={_text(v)}")]
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__)), "--ros-args", *words], cwd=ROOT,
            env={**os.environ, MARK: str(self._file), "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(folder)},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=(folder / "driver.log").open("wb"),
        )  # fmt: skip
        self.log = folder / "driver.log"

    def cpu(self) -> float:
        """CPU time so far, s."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def stop(self) -> np.ndarray:
        """End it and return the times, one cycle a row: due, begun, sample (middle of the read), published.

        The last two are 0 where no reply came in time.
        """
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)
        return np.load(self._file)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def main() -> int:
    """Run the node with a note of its times."""
    from rsea_ros.hardware.device import State
    from rsea_ros.nodes import driver
    from rsea_ros.nodes._bench_topics import BenchTopics

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
    atexit.register(lambda: np.save(os.environ[MARK], np.array(times).reshape(-1, 4)))
    return driver.main()


if __name__ == "__main__":
    sys.exit(main())
