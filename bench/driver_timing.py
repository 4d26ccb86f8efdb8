"""Cycles, latency and CPU at 280 Hz and 1 kHz, beside a bare loop with absolute deadlines meanwhile."""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from bench.driver_node import Node
from rsea_ros.hardware.peer.remote import RemoteBench

Row = tuple[str, str, str]
BARE = """
import sys, time
rate, seconds = float(sys.argv[1]), float(sys.argv[2])
first, began = time.monotonic_ns() + 1000000, []
for k in range(int(rate * seconds)):
    wait = first + round(k * 1e9 / rate) - time.monotonic_ns()
    if wait > 0:
        time.sleep(wait / 1e9)
    began.append(time.monotonic_ns())
import numpy
numpy.save(sys.argv[3], numpy.array(began))
"""
SETTLE = 4.0


def timing(args: argparse.Namespace, folder: Path) -> list[Row]:
    """Measure both rates."""
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rows: list[Row] = []
    for rate in (280.0, 1000.0):
        place = folder / f"{rate:g}"
        place.mkdir()
        rows += _at(rate, args.seconds, place)
    return rows


def _at(rate: float, seconds: float, folder: Path) -> list[Row]:
    patient = {"autostart": True, "lost_cycles": 100, "ft_timeout": 1.0, "command_timeout": 10.0}
    with RemoteBench(folder / "tty") as bench:
        node = Node(folder, rate=rate, baud=4_000_000, **bench.parameters(), **patient)
        received = _Receiver()
        received.spin(SETTLE)
        received.delays.clear()
        words = (str(rate), str(seconds), str(folder / "bare.npy"))
        bare = subprocess.Popen([sys.executable, "-c", BARE, *words])
        cpu, begin = node.cpu(), time.monotonic_ns()
        received.spin(seconds)
        cpu, end = node.cpu() - cpu, time.monotonic_ns()
        bare.wait()
        times = node.stop()
    times = times[(times[:, 0] > begin) & (times[:, 0] < end)]
    alone = np.load(folder / "bare.npy")
    return _rows(rate, seconds, times, np.diff(alone) / 1e6, cpu, np.array(received.delays) * 1e3)


def _rows(
    rate: float, seconds: float, times: np.ndarray, bare: np.ndarray, cpu: float, delays: np.ndarray
) -> list[Row]:
    """Return asked beside measured; bare and delays in ms."""
    period, late = 1e3 / rate, 1e3 / rate + 0.3
    began = np.diff(times[:, 0]) / 1e6
    whole = began.sum() / np.round(began / period).sum()
    published = (times[:, 2] - times[:, 1]) / 1e6
    here = f"{rate:g} Hz, {seconds:g} s"
    beyond, beyond_bare = int((began > late).sum()), int((bare > late).sum())
    return [
        (f"{here}: cycles later than {late:.1f} ms", "≤ 1.5 × bare loop",
         f"{beyond} of {len(began)}, bare {beyond_bare}, ratio {beyond / max(1, beyond_bare):.2f}"),
        (f"{here}: mean period", "exact to 0.1 %", f"off by {100 * abs(whole / period - 1):.4f} %"),
        (f"{here}: period p99, max", "", f"{np.quantile(began, 0.99):.3f}, {began.max():.2f} ms;"
         f" bare {np.quantile(bare, 0.99):.3f}, {bare.max():.2f} ms"),
        (f"{here}: bus read to published, p50, p99", "p99 < 0.5 ms",
         f"{np.median(published):.3f}, {np.quantile(published, 0.99):.3f} ms"),
        (f"{here}: stamp to reception elsewhere, p50, p99", "p99 < 1 ms",
         f"{np.median(delays):.3f}, {np.quantile(delays, 0.99):.3f} ms of {len(delays)}"),
        (f"{here}: CPU of the driver", "< 20 % at 280 Hz", f"{100 * cpu / seconds:.1f} %"),
    ]  # fmt: skip


class _Receiver:
    """A subscriber in this process; delays: from stamp to reception by the middleware, s."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from msg_adapters.ros import JointState, stamp_of
        from rsea_ros.nodes._qos import MEASUREMENT

        if not rclpy.ok():
            rclpy.init()
        self.delays: list[float] = []
        self._node = rclpy.create_node(f"reception{time.monotonic_ns()}")

        def heard(message: object, info: dict[str, int]) -> None:
            self.delays.append((info["received_timestamp"] - stamp_of(message.header.stamp)) / 1e9)

        self._node.create_subscription(JointState, "/rsea/joint_states", heard, MEASUREMENT)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def spin(self, seconds: float) -> None:
        """Receive for a while."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.1)
