"""From the fault that lateness latches to zero torque at the motor, by the bench's own log.

The controller is held up for most of the time, some periods at a stretch (bench/controller_node.py), also
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

from bench.controller_node import HOLD, MARK
from bench.torque_control_nodes import ROOT, Outside
from msg_adapters.ros import torque_command_message
from rsea_ros.hardware.peer.remote import RemoteBench

LONGEST = 8.0
"""s until the lateness is a fault."""
ASKED = 50.0
"""ms."""


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
        [sys.executable, str(ROOT / "bench" / "controller_node.py"), "--ros-args", *words], cwd=ROOT,
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
    """Hold its work up meanwhile."""
    process.send_signal(signal.SIGUSR1)
    try:
        yield
    finally:
        process.send_signal(signal.SIGUSR1)


def to_zero(
    outside: Outside, bench: RemoteBench, process: subprocess.Popen[bytes], file: Path
) -> tuple[str, str]:
    """Hold 10 N m, hold the controller up, and return what was measured and which fault it was."""
    begun, faults = time.monotonic_ns(), file.read_text().splitlines()
    end = time.monotonic() + LONGEST
    _hold(outside, lambda: abs(outside.wrenches[-1][1] - 10.0) < 2.0 or time.monotonic() > end)
    if time.monotonic() > end:
        return "torque not reached", "none"
    end = time.monotonic() + LONGEST
    with _held_up(process):
        _hold(outside, lambda: len(file.read_text().splitlines()) > len(faults) or time.monotonic() > end)
        time.sleep(0.3)
    new = file.read_text().splitlines()[len(faults) :]
    if not new:
        return "no fault", "none"
    at, _, fault = new[0].partition(" ")
    log = [(t, goal if on else 0) for t, goal, on in bench.log(begun)["torque"]]
    acting = [goal for t, goal in log if t <= int(at)][-1:] or [0]
    if not acting[0]:
        return "no torque acted any more", fault
    zero = next((t for t, goal in log if t > int(at) and goal == 0), None)
    return ("never" if zero is None else f"{(zero - int(at)) / 1e6:.0f}"), fault


def _hold(outside: Outside, condition: object) -> None:
    def held() -> bool:
        outside.desired.publish(torque_command_message(time.time_ns(), 10.0))
        time.sleep(2e-3)
        return bool(condition())  # type: ignore[operator]

    outside.until(held)


def row(here: str, runs: list[tuple[str, str]]) -> tuple[str, str, str]:
    """Return the row of some runs."""
    times = [float(each) for each, _ in runs if each.replace(".", "").isdigit()]
    others = sorted({each for each, _ in runs if not each.replace(".", "").isdigit()})
    told = "not measured"
    if times:
        told = f"median {median(times):.0f}, most {max(times):.0f} ms of {len(times)}"
    told += f"; else {', '.join(others)}" if others else ""
    last = next((fault for each, fault in reversed(runs) if each.isdigit()), runs[-1][1])
    return f"{here}: late commands to zero torque", f"≤ {ASKED:g} ms", f"{told}; {last}"
