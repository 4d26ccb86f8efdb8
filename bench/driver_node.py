"""The driver node in a process of its own, with the times of its cycles and publications written down."""

from __future__ import annotations

import atexit
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MARK = "RSEA_BENCH_TIMES"


class Node:
    """A driver in a process; `times` after its end: monotonic ns of every cycle's start and publication."""

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
        """End it and return the times, one cycle a row: begun, sample (middle of the read), published."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)
        return np.load(self._file)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def main() -> int:
    """Run the node with a note of its times."""
    from rsea_ros.nodes import driver
    from rsea_ros.nodes._bench import Bench

    times: list[tuple[int, int, int]] = []
    begun = [0]
    step, publish = driver.Driver._step, Bench.publish

    def noted_step(self: driver.Driver, stamp: int) -> None:
        begun[0] = time.monotonic_ns()
        step(self, stamp)

    def noted_publish(self: Bench, state: driver.Guarded) -> None:
        publish(self, state)
        now = time.monotonic_ns()
        times.append((begun[0], state.stamp - time.time_ns() + now, now))

    driver.Driver._step, Bench.publish = noted_step, noted_publish
    atexit.register(lambda: np.save(os.environ[MARK], np.array(times, dtype=np.int64)))
    return driver.main()


if __name__ == "__main__":
    sys.exit(main())
