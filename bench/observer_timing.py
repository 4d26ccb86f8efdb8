"""The model node in its place: plant, excite and model in processes of their own, this one receives.

Beside it, in the same run: how long ft itself takes to here, and a bare loop with absolute deadlines.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.driver_timing import BARE
from bench.observer_node import MARK
from rsea_ros.signals import FloatArray

ROOT = Path(__file__).resolve().parents[1]
SETTLE, PATIENCE = 3.0, 120.0


def timing(args: argparse.Namespace) -> Iterator[str]:
    """Measure at 280 Hz and 1 kHz."""
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    yield f"{'what':58} {'asked':18} p50, p99"
    for rate in (280.0, 1000.0):
        with tempfile.TemporaryDirectory() as folder:
            yield from _at(rate, args.seconds, Path(folder))


def _at(rate: float, seconds: float, folder: Path) -> Iterator[str]:
    times = folder / "times.npy"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(folder), MARK: str(times)}
    nodes = [_start(words, folder, environment) for words in (
        ["-m", "rsea_ros.nodes.plant", "--ros-args", "-p", f"rate:={rate}"],
        [str(ROOT / "bench/observer_node.py")],
        ["-m", "rsea_ros.nodes.excite", "--ros-args", "-p", f"rate:={rate}", "-p", "kind:=multisine",
         "-p", "amplitude:=8.0", "-p", "high:=40.0", "-p", f"duration:={seconds + 60.0}"],
    )]  # fmt: skip
    try:
        received = _Received()
        received.wait()
        received.spin(SETTLE)
        received.forget()
        bare = _start(["-c", BARE, str(rate), str(seconds), str(folder / "bare.npy")], folder, environment)
        begin, cpu = time.monotonic_ns(), _cpu(nodes[1])
        received.spin(seconds)
        end, cpu = time.monotonic_ns(), _cpu(nodes[1]) - cpu
        bare.wait()
    finally:
        for node in nodes:
            node.send_signal(signal.SIGINT)
        for node in nodes:
            node.wait()
    rows = np.load(times)
    rows = rows[(rows[:, 0] > begin) & (rows[:, 0] < end)]
    lateness = np.abs(np.diff(np.load(folder / "bare.npy")) / 1e6 - 1e3 / rate)
    yield from _told(rate, rows, received, lateness, cpu / seconds)


def _told(
    rate: float, rows: FloatArray, received: _Received, lateness: FloatArray, cpu: float
) -> Iterator[str]:
    here = f"{rate:g} Hz: "
    yield _line(here + "observer and flag, µs", "p99 < 60", rows[:, 3] / 1e3)
    yield _line(here + "the same, CPU time of the thread, µs", "", rows[:, 4] / 1e3)
    yield _line(here + "ft callback to torque_estimate published, ms", "p99 < 0.3", rows[:, 1] / 1e6)
    yield _line(here + "the same, CPU time of the thread, ms", "", rows[:, 2] / 1e6)
    yield _line(here + "ft stamp to torque_estimate received, ms", "p99 < 1.2 at 1 kHz", received.estimates())
    yield _line(here + "ft stamp to ft itself received, ms", "", received.wrenches())
    yield _line(here + "bare loop, off its period, ms", "", lateness)
    yield f"{here + 'CPU of the model node':58} {'< 15 % at 280 Hz':18} {100.0 * cpu:.1f} % of a core"


def _line(what: str, asked: str, values: FloatArray) -> str:
    p50, p99 = np.quantile(values, [0.5, 0.99])
    return f"{what:58} {asked:18} {p50:.3f}, {p99:.3f}   ({len(values)} values)"


def _start(words: list[str], folder: Path, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    log = (folder / f"{len(list(folder.iterdir()))}.log").open("wb")
    return subprocess.Popen([sys.executable, *words], env=environment, cwd=ROOT, stdin=subprocess.DEVNULL,
                            stdout=log, stderr=log)  # fmt: skip


def _cpu(process: subprocess.Popen[bytes]) -> float:
    """Return the CPU time of a process so far, s."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class _Received:
    """Delays from stamp to reception by the middleware of this process, ms."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from msg_adapters.ros import JointState, WrenchStamped, stamp_of
        from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

        if not rclpy.ok():
            rclpy.init()
        self._delays: dict[str, list[float]] = {"torque_estimate": [], "ft": []}
        self._node = rclpy.create_node(f"reception{time.monotonic_ns()}")

        def listen(kind: type, topic: str, qos: object) -> None:
            def heard(message: object, info: dict[str, int]) -> None:
                delay = info["received_timestamp"] - stamp_of(message.header.stamp)  # type: ignore[attr-defined]
                self._delays[topic].append(delay / 1e6)

            self._node.create_subscription(kind, f"/rsea/{topic}", heard, qos)

        listen(JointState, "torque_estimate", COMMAND)
        listen(WrenchStamped, "ft", MEASUREMENT)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def spin(self, seconds: float) -> None:
        """Receive for a while."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.1)

    def wait(self) -> None:
        """Receive until estimates come."""
        deadline = time.monotonic() + PATIENCE
        while len(self._delays["torque_estimate"]) < 100 and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.1)

    def forget(self) -> None:
        """Count from now on."""
        for delays in self._delays.values():
            delays.clear()

    def estimates(self) -> FloatArray:
        """Return the delays of torque_estimate."""
        return np.array(self._delays["torque_estimate"])

    def wrenches(self) -> FloatArray:
        """Return the delays of ft."""
        return np.array(self._delays["ft"])
