"""The torque controller through real nodes: plant and controller processes, a sender of desired torques here.

Run: python bench/torque_control_nodes.py [--rate 280 1000]. The error is that of a sine of 5 Hz, the median
over its periods, so a stall of the machine shows in `worst` and in the late commands, not in it.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import rclpy
from rclpy.executors import SingleThreadedExecutor

from msg_adapters.ros import (
    DiagnosticArray,
    JointState,
    WrenchStamped,
    effort_of,
    torque_command_message,
    wrench_of,
)
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

ROOT = Path(__file__).resolve().parents[1]
HZ, SECONDS, SETTLE, LEAD = 5.0, 6.0, 1.0, 0.2


@dataclass(frozen=True)
class Case:
    """What the plant is, what the controller believes, amplitude (N m) of the sine, error asked for (%)."""

    name: str
    true: Rig
    model: Rig
    amplitude: float
    asked: float


class Outside:
    """A node that sends desired torques and hears the bench."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("bench", namespace="rsea")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.wrenches: list[tuple[int, float]] = []
        self.commands: list[tuple[int, int]] = []
        self.health: dict[str, dict[str, str]] = {}
        self.desired = self.node.create_publisher(JointState, "desired_torque", COMMAND)
        self.node.create_subscription(WrenchStamped, "ft", self._on_ft, MEASUREMENT)
        self.node.create_subscription(JointState, "torque_command", self._on_command, COMMAND)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, COMMAND)

    def until(self, condition: Callable[[], Any], timeout: float = 60.0) -> None:
        """Spin until a condition holds."""
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the nodes did not answer")
            self._executor.spin_once(timeout_sec=0.05)

    def _on_ft(self, message: WrenchStamped) -> None:
        self.wrenches.append(wrench_of(message))

    def _on_command(self, message: JointState) -> None:
        self.commands.append((effort_of(message)[0], time.time_ns()))

    def _on_health(self, message: DiagnosticArray) -> None:
        status = message.status[0]
        self.health[status.name.rpartition("/")[2]] = {pair.key: pair.value for pair in status.values}


@contextmanager
def running(name: str, **parameters: object) -> Iterator[None]:
    """Run a node in its own process."""
    words = [w for key, value in parameters.items() for w in ("-p", f"{key}:={value}")]
    command = [sys.executable, "-m", f"rsea_ros.nodes.{name}", "--ros-args", *words]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def measure(case: Case, rate: float, folder: Path) -> tuple[float, float, float, str]:
    """Return the error, median over periods and worst, %; command ahead (ms, median); late commands."""
    paths = [folder / f"{name}.yaml" for name in ("true", "model")]
    for rig, path in zip((case.true, case.model), paths, strict=True):
        save_rig(rig, path)
    outside = Outside()
    with (
        running("plant", rig=f"'{paths[0]}'", rate=rate),
        running("controller", rig=f"'{paths[1]}'", rate=rate, stale=1.0),
    ):
        outside.until(lambda: len(outside.commands) > rate and outside.desired.get_subscription_count())
        errors = sine(outside, case.amplitude, rate)
    lead = np.median([(stamp - heard) / 1e6 for stamp, heard in outside.commands[-int(2 * rate) :]])
    late = outside.health.get("plant", {}).get("late_commands", "?")
    outside.node.destroy_node()
    return 100 * float(np.median(errors)), 100 * float(np.max(errors)), float(lead), late


def sine(outside: Outside, amplitude: float, rate: float) -> list[float]:
    """Send a sine ahead of time on the grid of the measurements; return its relative error by period."""
    start = outside.wrenches[-1][0] + round(0.3 * rate) / rate * SECOND
    for k in range(round(SECONDS * rate)):
        stamp, t = round(start + k * SECOND / rate), k / rate
        outside.until(lambda stamp=stamp: stamp < time.time_ns() + LEAD * SECOND)  # type: ignore[misc]
        wanted = amplitude * np.sin(2 * np.pi * HZ * t) * min(1.0, 4.0 * t)
        outside.desired.publish(torque_command_message(stamp, wanted))
    outside.until(lambda: outside.wrenches[-1][0] > start + (SECONDS - 0.1) * SECOND)
    read = np.array(outside.wrenches)
    t = (read[:, 0] - start) / SECOND
    inside = (t > SETTLE) & (t < SECONDS - 0.2)
    error = (read[:, 1] - amplitude * np.sin(2 * np.pi * HZ * t))[inside]
    period = np.floor(t[inside] * HZ)
    rms = amplitude / np.sqrt(2.0)
    return [float(np.sqrt(np.mean(error[period == p] ** 2))) / rms for p in np.unique(period)]


def cases() -> Sequence[Case]:
    """Return what issue 6 asks for."""
    clamped, free = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
    rough = clamped.with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    worn = clamped.with_effects(EffectSetting("backlash", {"gap": 5.0 / 60.0 * np.pi / 180.0}))
    return (
        Case("locked, 10 N m", clamped, clamped, 10.0, 2.0),
        Case("free, 4.7 N m", free, free, 4.7, 4.0),
        Case("3 N m friction, not in the model", rough, clamped, 10.0, 6.0),
        Case("3 N m friction, in the model", rough, rough, 10.0, 2.5),
        Case("5 arcmin backlash, in the model", worn, worn, 10.0, 100.0),
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, nargs="+", default=[280.0], help="Hz (default 280)")
    args = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init()
    head = f"{'rate':>8}  {'sine of 5 Hz':34}{'asked %':>8}{'error %':>9}{'worst %':>9}"
    print(f"{head}{'ahead ms':>10}{'late':>7}")
    for rate in args.rate:
        for case in cases():
            with tempfile.TemporaryDirectory() as folder:
                error, worst, lead, late = measure(case, rate, Path(folder))
            numbers = f"{case.asked:8.1f}{error:9.2f}{worst:9.2f}{lead:10.2f}{late:>7}"
            print(f"{rate:5.0f} Hz  {case.name:34}{numbers}", flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
