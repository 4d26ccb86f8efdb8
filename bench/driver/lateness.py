"""From the fault that lateness latches to zero torque at the motor, by stamps of the measured motor torque.

The driver drives the simulation: on a pseudo-terminal a busy machine latches faults of the wire first. The
controller is held up before each of its commands (bench/control/node.py), also
while its fault takes the torque away.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

from bench.control.node import HOLD, MARK
from bench.control.nodes import ROOT, Outside
from msg_adapters.ros import torque_command_message
from msg_adapters.topic_map import JOINT_STATE
from rsea_ros.nodes._mailbox import Mailbox, MessageFields
from rsea_ros.nodes._qos import MEASUREMENT

LONGEST = 8.0
"""s until the lateness is a fault."""
ASKED = 50.0
"""ms."""
SMALL, REACHED = 0.5, 8.0
"""N m of the motor that count as noise, and as the commanded torque."""


class Torques:
    """The motor torque that the driver measures, by its stamps."""

    def __init__(self, outside: Outside) -> None:
        torque = MessageFields(JOINT_STATE, (("effort", 0),))
        self._mailbox = Mailbox(outside.node, "joint_states", torque, MEASUREMENT, lambda: None)
        self.heard: list[tuple[int, float]] = []

    def newest(self) -> float:
        """Return the newest torque, N m."""
        self.heard += [(stamp, torque) for stamp, (torque,), _ in self._mailbox.take()]
        return self.heard[-1][1] if self.heard else 0.0


@contextmanager
def noted_controller(
    folder: Path, rate: float, **parameters: object
) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Run the controller; yield its process and the file of its faults."""
    file = folder / "faults.txt"
    file.touch()
    parameters["rate"] = rate
    words = [w for key, value in parameters.items() for w in ("-p", f"{key}:={value}")]
    process = subprocess.Popen(
        [sys.executable, str(ROOT / "bench" / "control" / "node.py"), "--ros-args", *words], cwd=ROOT,
        env={**os.environ, MARK: str(file), HOLD: f"{1.0 / rate}", "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield process, file
    finally:
        process.terminate()
        process.wait()


@contextmanager
def _held_up(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """Delay the controller's work within a with statement."""
    process.send_signal(signal.SIGUSR1)
    try:
        yield
    finally:
        process.send_signal(signal.SIGUSR1)


def to_zero(
    outside: Outside, torques: Torques, process: subprocess.Popen[bytes], file: Path
) -> tuple[str, str]:
    """Hold 10 N m, delay the controller, and return the measured torques and the fault."""
    faults = file.read_text().splitlines()
    end = time.monotonic() + LONGEST
    hold(outside, lambda: torques.newest() > REACHED or time.monotonic() > end)
    if time.monotonic() > end:
        return "torque not reached", "none"
    end = time.monotonic() + LONGEST
    with _held_up(process):
        hold(outside, lambda: len(file.read_text().splitlines()) > len(faults) or time.monotonic() > end)
        for _ in range(30):
            time.sleep(0.01)
            torques.newest()
    new = file.read_text().splitlines()[len(faults) :]
    if not new:
        return "no fault", "none"
    at, _, fault = new[0].partition(" ")
    latched = int(at) + time.time_ns() - time.monotonic_ns()
    before = [torque for stamp, torque in torques.heard if stamp <= latched]
    if not before or abs(before[-1]) < SMALL:
        return "no torque acted any more", fault
    after = [(stamp, torque) for stamp, torque in torques.heard if stamp > latched]
    last = max((k for k, (_, torque) in enumerate(after) if abs(torque) > SMALL), default=-1)
    if last + 1 >= len(after):
        return "never", fault
    return f"{(after[last + 1][0] - latched) / 1e6:.0f}", fault


def hold(outside: Outside, condition: object) -> None:
    """Desire 10 N m until a condition holds."""

    def done() -> bool:
        outside.desired.publish(torque_command_message(time.time_ns(), 10.0))
        time.sleep(2e-3)
        return bool(condition())  # type: ignore[operator]

    outside.until(done)


def row(label: str, runs: list[tuple[str, str]]) -> tuple[str, str, str]:
    """Return the row of some runs."""
    times = [float(each) for each, _ in runs if each.replace(".", "").isdigit()]
    others = sorted({each for each, _ in runs if not each.replace(".", "").isdigit()})
    told = "not measured"
    if times:
        told = f"median {median(times):.0f}, most {max(times):.0f} ms of {len(times)}"
    told += f"; else {', '.join(others)}" if others else ""
    last = next((fault for each, fault in reversed(runs) if each.isdigit()), runs[-1][1])
    return f"{label}: late commands to zero torque", f"≤ {ASKED:g} ms", f"{told}; {last}"
