"""The torque controller through real nodes: plant and controller as processes, desired torques from here.

Run: python -m bench control nodes [--rate 280 1000] [--priority 0 80]. The error is that of a sine of
5 Hz, the median over its periods, so a stall of the machine shows in `worst` and in the late commands, not in
it. With a priority controller and, one above it, plant run at SCHED_FIFO.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import rclpy

from bench import ROOT
from bench.driver.bare_loop import may_have
from bench.processes import own_domain
from msg_adapters.ros import DiagnosticArray, JointState, torque_command_message
from msg_adapters.topic_map import AXES, JOINT_STATE, WRENCH
from rsea_ros.control.controller import TorqueLimits
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._mailbox import Mailbox, MessageFields, Polled
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

HZ, SECONDS, SETTLE, LEAD = 5.0, 6.0, 1.0, 0.2


@dataclass(frozen=True)
class Case:
    """The plant, the controller's rig, amplitude (N m) of the sine, largest allowed error (%).

    asked: None without such a limit. limit: of the motor's torque, N m. A controller knows the
    rig held at both ends, not the load that it meets.
    """

    name: str
    true: Rig
    model: Rig
    amplitude: float
    asked: float | None
    limit: float = TorqueLimits().torque


class Outside:
    """Sends desired torques and hears the bench: wrenches and commands as (stamp, torque, heard)."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("bench", namespace="rsea")
        self.wrenches: list[tuple[int, float, int]] = []
        self.commands: list[tuple[int, float, int]] = []
        self.health: dict[str, dict[str, str]] = {}
        self.desired = self.node.create_publisher(JointState, "desired_torque", COMMAND)
        self._ft, self._torques = (
            Mailbox(self.node, topic, MessageFields(kind, (field,)), qos, lambda: None)
            for kind, topic, qos, field in (
                (WRENCH, "ft", MEASUREMENT, ("wrench", AXES.index("torque.z"))),
                (JOINT_STATE, "torque_command", COMMAND, ("effort", 0)),
            )
        )
        self._diagnostics: Any = self.node.create_subscription(
            DiagnosticArray, "/diagnostics", lambda message: None, COMMAND, callback_group=Polled()
        )

    def until(self, condition: Callable[[], Any], timeout: float = 60.0) -> None:
        """Listen until a condition holds. Polling every ms loads the machine less than an executor."""
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the nodes did not answer")
            time.sleep(1e-3)
            self._hear()

    def _hear(self) -> None:
        for mailbox, heard in ((self._ft, self.wrenches), (self._torques, self.commands)):
            heard += [(stamp, number, received) for stamp, (number,), received in mailbox.take()]
        handle = self._diagnostics.handle
        with handle:
            while (message := handle.take_message(DiagnosticArray, False)) is not None:
                status = message[0].status[0]
                name = status.name.rpartition("/")[2]
                self.health[name] = {pair.key: pair.value for pair in status.values}


@contextmanager
def run_node_process(name: str, priority: int, **parameters: object) -> Iterator[None]:
    """Run a node in its own process. priority: of SCHED_FIFO for all of it, 0: none."""
    words = [w for key, value in parameters.items() for w in ("-p", f"{key}:={value}")]
    command = [sys.executable, "-m", f"rsea_ros.nodes.{name}", "--ros-args", *words]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    if priority:
        os.sched_setscheduler(process.pid, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def measure(case: Case, rate: float, priority: int, folder: Path) -> tuple[float, float, float, str]:
    """Return the error, median over periods and worst, %; command ahead (ms, median); late commands."""
    paths = [folder / f"{name}.yaml" for name in ("true", "model")]
    for rig, path in zip((case.true, case.model), paths, strict=True):
        save_rig(rig, path)
    outside = Outside()
    with (
        run_node_process("plant", priority and priority + 1, rig=f"'{paths[0]}'", rate=rate),
        run_node_process(
            "controller", 0, rig=f"'{paths[1]}'", rate=rate, stale=1.0, realtime_priority=priority,
            torque_limit=case.limit,
        ),
    ):  # fmt: skip
        outside.until(lambda: outside.desired.get_subscription_count() and outside.wrenches)
        outside.until(lambda: len(outside.commands) > rate)
        errors = sine(outside, case.amplitude, rate)
    lead = np.median([(stamp - heard) / 1e6 for stamp, _, heard in outside.commands[-int(2 * rate) :]])
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
    """Return the benches of the trials."""
    clamped, free = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
    rough = clamped.with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    worn = clamped.with_effects(EffectSetting("backlash", {"gap": 5.0 / 60.0 * np.pi / 180.0}))
    return (
        Case("locked, 10 N·m", clamped, clamped, 10.0, 2.0),
        Case("free, load unknown, 4.7 N·m", free, clamped, 4.7, 4.0),
        Case("free, 10 N·m, motor of 150 N·m", free, clamped, 10.0, 4.0, 150.0),
        Case("3 N·m friction, not in the model", rough, clamped, 10.0, 6.0),
        Case("3 N·m friction, in the model", rough, rough, 10.0, 2.5),
        Case("5 arcmin backlash, in the model", worn, worn, 10.0, None),
    )


def main(*, rate: tuple[float, ...] = (280.0, 1000.0), priority: tuple[int, ...] = (0, 80)) -> None:
    """Measure and print.

    rate: Hz
    priority: SCHED_FIFO; 0: none
    """
    own_domain()
    rclpy.init()
    head = f"{'':18}{'sine of 5 Hz':34}{'required':>8}{'error %':>9}{'worst %':>9}"
    print(f"{head}{'ahead ms':>10}{'late':>7}")
    for hz, fifo in product(rate, filter(may_have, priority)):
        setup = f"{hz:g} Hz" + (f", FIFO {fifo}" if fifo else "")
        for case in cases():
            with tempfile.TemporaryDirectory() as folder:
                error, worst, lead, late = measure(case, hz, fifo, Path(folder))
            asked = "" if case.asked is None else f"{case.asked:.1f}"
            numbers = f"{asked:>8}{error:9.2f}{worst:9.2f}{lead:10.2f}{late:>7}"
            print(f"{setup:18}{case.name:34}{numbers}", flush=True)
    rclpy.shutdown()
