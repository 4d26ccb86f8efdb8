"""Controller and driver together on a simulated bench, quiet and beside processes that burn every core.

A sine of 5 Hz, 10 N m, 4.7 N m with a free end: its error, RMS, by period, and the largest |ft|, which a load
may not raise. In each trial a bare loop shows how late this machine is.

Each rate as any process, and with both nodes at SCHED_FIFO where permitted (--priority), with the defaults of
config/nodes but for 4 Mbit/s. The bench runs at SCHED_FIFO where permitted, above both nodes: motor and
sensor have processors of their own, and at 1 kHz a bench that waits for one is a motor that does not answer.
So do the kernel's workers that are its wire (`hurried_wire`). At SCHED_FIFO each node keeps to a processor
of its own (cpu_affinity), the bench to none.
"""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from bench.processes import hurried_wire, may_have, own_domain, run_node
from bench.results import Row
from msg_adapters.ros import DiagnosticArray, JointState, Trigger, torque_command_message
from msg_adapters.topic_map import AXES, JOINT_STATE, WRENCH
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.nodes._tap import Mailbox, MessageFields, Polled


class Kind(NamedTuple):
    """A bench: its rig, amplitude of the sine (N m), largest allowed error (%)."""

    name: str
    rig: str
    amplitude: float
    asked: float


LOCKED = Kind("locked", "paper_high_impedance", 10.0, 2.0)
FREE = Kind("free", "paper_moving_output", 4.7, 4.0)
"""4.7 N m: a motor of 68 N m cannot make more on a free end."""
PATIENT = {"latency": 0.02, "lost_cycles": 30, "ft_timeout": 0.5, "command_timeout": 0.5, "watchdog": 1.0}
"""Limits of config/simulated_bench.yaml: without them few restarts beside other work come to a torque."""
SHARES, RESTARTS, CALM, REACHED = (0.5, 0.1), 10, 10.0, 3.0
"""late_share, its default and one that a busy machine reaches; s before a fault is cleared, and at torque."""
START = {"autostart": True, "resume": True, "allow_no_position_limit": True}
BURN = "while True: pass"
HZ, SECONDS, SETTLE, LEAD = 5.0, 6.0, 1.0, 0.2
"""Of a sine, and s: its length, before it counts, ahead of its stamps."""


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


@contextmanager
def burn_cores(count: int) -> Iterator[None]:
    """Run this many processes that only compute."""
    processes = [subprocess.Popen([sys.executable, "-c", BURN]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def controller(
    folder: Path, *, rate: tuple[float, ...] = (280.0, 1000.0), priority: tuple[int, ...] = (0, 80)
) -> Iterator[Row]:
    """Try every rate, quiet and loaded."""
    own_domain()
    rclpy.init()
    for hz, fifo in product(rate, filter(may_have, priority)):
        for bench, load in ((LOCKED, 0), (FREE, 0), (LOCKED, os.cpu_count() or 1)):
            yield _trial(bench, hz, load, fifo, folder / f"{bench.name}{hz:g}-{load}-{fifo}")
    rclpy.shutdown()


def restarts(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Start the controller anew under 10 N·m beside processes that burn every core: torque at the motor."""
    own_domain()
    rclpy.init()
    for share in SHARES:
        outside = Outside()
        with ExitStack() as kept:
            bench = kept.enter_context(RemoteBench(folder / f"restarts{share}"))
            bench.hurry()
            kept.enter_context(hurried_wire(49))
            parameters = {**bench.parameters(), "baud": 4_000_000, **START, **PATIENT}
            kept.enter_context(run_node("driver", **parameters))
            kept.enter_context(burn_cores(os.cpu_count() or 1))
            runs = [_restart(outside, bench, share) for _ in range(RESTARTS)]
        outside.node.destroy_node()
        told = f"most {max(peak for peak, _ in runs):.2f} N·m, "
        told += f"{sum(reached for _, reached in runs)} of {RESTARTS} came to 10 N·m"
        yield f"controller started {RESTARTS} times under 10 N·m, late_share {share:g}", "≤ 13 N·m", told
    rclpy.shutdown()


def _restart(outside: Outside, bench: RemoteBench, share: float) -> tuple[float, bool]:
    """Return the largest torque at the motor, N m, and whether ft came to 10 N m; faults are cleared."""
    since, now = bench.ask("torque")["t"], time.monotonic()
    reached, clear, end = False, now + CALM, now + 4.0 * CALM
    outside.wrenches.clear()

    def is_over() -> bool:
        nonlocal reached, clear, end
        outside.desired.publish(torque_command_message(time.time_ns(), 10.0))
        time.sleep(2e-3)
        now = time.monotonic()
        if not reached and outside.wrenches and abs(outside.wrenches[-1][1] - 10.0) < 1.0:
            reached, end = True, now + REACHED
        if not reached and now > clear:
            clear = now + CALM
            for name in ("driver", "controller"):
                _call(outside, Trigger, f"{name}/clear_fault", Trigger.Request())
        return now > end

    with run_node("controller", late_share=share):
        outside.until(is_over)
    unit = TABLES[54024].ampere * 6.826
    peaks = [abs(goal) * unit for _, goal, on in bench.log(since)["torque"] if on]
    return max(peaks, default=0.0), reached


def _trial(kind: Kind, rate: float, load: int, priority: int, path: Path) -> Row:
    """Run one trial; a fault ends the sine, which is part of the requirement."""
    outside, allowed = Outside(), os.sched_getaffinity(0)
    first, last = (min(allowed), max(allowed)) if priority else (-1, -1)
    both = {"rate": rate, "realtime_priority": priority, "rig": kind.rig}
    with ExitStack() as kept:
        bench = kept.enter_context(RemoteBench(path, "--rig", kind.rig))
        bench.hurry(priority + 1 if priority else 50)
        kept.enter_context(hurried_wire(priority and priority - 1))
        kept.enter_context(
            run_node("driver", **bench.parameters(), **START, **both, baud=4_000_000, cpu_affinity=first)
        )
        kept.enter_context(run_node("controller", cpu_affinity=last, **both))
        outside.until(lambda: outside.wrenches and len(outside.commands) > 50)
        kept.enter_context(burn_cores(load))
        late = _lateness(rate)
        _drive(outside)
        begun = time.monotonic_ns()
        errors = sine(outside, kind.amplitude, rate) or [math.nan]  # none: torque or ft was lost
        largest, faults = max(abs(torque) for _, torque, _ in outside.wrenches), _faults(outside)
        stood = bench.stood_still(begun)  # asked first: the bench stands still while it writes its log
        acting = sum(goal != 0 and on for _, goal, on in bench.log(begun)["torque"])
    outside.node.destroy_node()
    health = outside.health.get("controller", {})
    name = f"{kind.name}, {rate:g} Hz, {f'beside {load} that burn' if load else 'quiet'}"
    asked = f"≤ {1.3 * kind.amplitude:.3g} N·m" + (f", ≤ {kind.asked:g} %" if not load else "")
    return Row(name + (f", FIFO {priority}" if priority else ""), asked, {
        "largest ft, N·m": f"{largest:.2f}", "error, %: median of periods": f"{100.0 * median(errors):.2f}",
        "worst": f"{100.0 * max(errors):.1f}", "faults": "; ".join(faults) or "none",
        "writes of torque": str(acting), "feedback at the end": health.get("feedback_share", "?"),
        "late commands": health.get("late_commands", "?"),
        "measurements missed": health.get("missed_measurements", "?"),
        "bare loop late, %": f"{100.0 * late:.1f}", "bench stood still, ms": f"{stood:.1f}",
    })  # fmt: skip


def _drive(outside: Outside) -> None:
    """End the faults that the start of everything at once has latched; without torque it is not activated."""
    for _ in range(5):
        for name in ("driver", "controller"):
            _call(outside, Trigger, f"{name}/clear_fault", Trigger.Request())
        activate = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_ACTIVATE))
        if outside.health.get("driver", {}).get("active") != "True":
            _call(outside, ChangeState, "driver/change_state", activate)
        heard = len(outside.wrenches)
        outside.until(lambda: len(outside.wrenches) > heard + 300)  # noqa: B023  called at once
        if outside.health["driver"]["active"] == "True" and not _faults(outside):
            return


def _faults(outside: Outside) -> list[str]:
    """Return the faults that the nodes reported last."""
    return [v["fault"] for v in outside.health.values() if v.get("fault", "none") != "none"]


def _call(outside: Outside, kind: Any, name: str, request: Any) -> None:
    client = outside.node.create_client(kind, name)
    client.wait_for_service(20.0)
    rclpy.spin_until_future_complete(outside.node, client.call_async(request), timeout_sec=10.0)
    outside.node.destroy_client(client)


def _lateness(rate: float) -> float:
    """Return the share of cycles of a bare loop that begin 0.3 ms late or more, over a second."""
    begin, late = time.monotonic(), 0
    for k in range(1, round(rate) + 1):
        due = begin + k / rate
        time.sleep(max(0.0, due - time.monotonic()))
        late += time.monotonic() - due > 3e-4
    return late / round(rate)
