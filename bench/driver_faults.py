"""Each fault: cycles until it is latched, time until the torque is zero on the wire, by the bench's clock."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from bench.driver_loop import Loop
from rsea_ros.hardware.peer.remote import RemoteBench

RATE = 280.0
FAULTS = {
    "silent motor": (("misbehave", {"silent": True}), ("misbehave", {"silent": False}), "clear"),
    "wrong CRC": (("misbehave", {"wrong_crc": 1.0}), ("misbehave", {"wrong_crc": 0.0}), "clear"),
    "truncated": (("misbehave", {"truncate": 1.0}), ("misbehave", {"truncate": 0.0}), "clear"),
    "corrupt": (("misbehave", {"corrupt": 1.0}), ("misbehave", {"corrupt": 0.0}), "clear"),
    "late replies": (("misbehave", {"delay": 1.0, "late": 0.1}), ("misbehave", {"delay": 0.0}), "clear"),
    "hot": (("set", {"temperature": 80}), ("set", {"temperature": 30}), "clear"),
    "hardware alert and shutdown": (("alert", {"bits": 0x20}), None, "reboot"),
    "voltage sag": (("sag", {"voltage": 15.0}), None, "reboot"),
    "F/T saturated": (("ft_status", {"bits": 0x80020000}), ("ft_status", {"bits": 0}), "clear"),
    "F/T silent": (("misbehave", {"ft_silent": True}), ("misbehave", {"ft_silent": False}), "clear"),
    "F/T restart": (("ft_restart", {}), None, "clear"),
}


def faults(args: argparse.Namespace, folder: Path) -> list[tuple[str, str, str]]:
    """Provoke each, five times."""
    rows = []
    with RemoteBench(folder / "tty") as bench:
        loop = Loop(bench, RATE)
        for name in FAULTS:
            runs = [_once(loop, bench, name) for _ in range(5)]
            cycles, zero, times = (sorted(column) for column in zip(*runs, strict=True))
            measured = f"cycles {cycles[2]} (most {cycles[-1]}), zero {zero[2]:.2f} ms (most {zero[-1]:.2f})"
            total = f"from the start {times[2]:.1f} ms"
            asked = "≤ 3 cycles, ≤ 5 ms"
            rows.append((f"{name}: latched, torque zero after that", asked, f"{measured}, {total}"))
        loop.device.close()
    return rows


def _once(loop: Loop, bench: RemoteBench, name: str) -> tuple[int, float, float]:
    """Return cycles to the latch, ms from there to the last torque's end, ms from the fault's start to it."""
    (wrong, how), right, service = FAULTS[name]
    _calm(loop, service)
    begun = bench.ask(wrong, **how)["t"]
    cycles = 0
    while loop.guarded.fault is None and cycles < 1000:
        loop.cycle(10.0)
        cycles += 1
    latched = time.monotonic_ns()
    for _ in range(4):
        loop.cycle(10.0)
    ended = next((t for t, goal, on in bench.log(begun)["torque"] if goal == 0 or not on), 0)
    if right is not None:
        bench.ask(right[0], **right[1])
    if service == "reboot":
        bench.ask("set", voltage=240)
    getattr(loop.guarded, service)()
    return cycles, (ended - latched) / 1e6, (ended - begun) / 1e6


def _calm(loop: Loop, service: str) -> None:
    """Run until torque acts; clear what a stall of the machine has latched."""
    for _ in range(20):
        loop.cycle(10.0)
    if loop.guarded.fault is not None:
        loop.guarded.clear()
        _calm(loop, service)
