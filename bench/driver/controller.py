"""Controller and driver together on a simulated bench, quiet and beside processes that burn every core.

A sine of 5 Hz, 10 N m, 4.7 N m with a free end: its error, RMS, by period, and the largest |ft|, which a load
may not raise. In each trial a bare loop shows how late this machine is, and once the driver has left the
terminal a loop of only the two requests to the motor shows how long replies take and how many faults the
driver's rule would make of that. A quiet trial in which the driver lost replies, and that loop would have
too, is done again, at most TRIES times; the row says so.

Each rate as any process, and with both nodes at SCHED_FIFO where permitted (--priority), with the defaults of
config/nodes but for 4 Mbit/s. The bench runs at SCHED_FIFO where permitted, above both nodes: motor and
sensor have processors of their own, and at 1 kHz a bench that waits for one is a motor that does not answer.
So do the kernel's workers that are its wire (hurried_wire.py). At SCHED_FIFO each node keeps to a processor
of its own (cpu_affinity), the bench to none.

The last row of a rate is another trial, with the simulated motor in place of the wire: the controller is held
up until lateness latches a fault, and the time from that to zero torque is measured (lateness.py).
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from bench.control.nodes import Outside, run_node_process, sine
from bench.driver.bare_loop import may_have
from bench.driver.bare_wire import ALONE, wire_alone
from bench.driver.hurried_wire import hurried_wire
from bench.driver.lateness import Torques, hold, noted_controller, row, to_zero
from msg_adapters.ros import Trigger
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.hardware.peer.remote import RemoteBench


class Kind(NamedTuple):
    """A bench: its rig, amplitude of the sine (N m), largest allowed error (%)."""

    name: str
    rig: str
    amplitude: float
    asked: float


class Trial(NamedTuple):
    """The outcome of a trial: a sentence; largest |ft|, N m; whether replies were lost; the wire alone."""

    told: str
    largest: float
    lost: bool
    wire_faults: int
    alone: str


LOCKED = Kind("locked", "paper_high_impedance", 10.0, 2.0)
FREE = Kind("free", "paper_moving_output", 4.7, 4.0)
"""4.7 N m: a motor of 68 N m cannot make more on a free end."""
PATIENT = {"latency": 0.02, "lost_cycles": 30, "ft_timeout": 0.5, "command_timeout": 0.5, "watchdog": 1.0}
"""Limits of config/simulated_bench.yaml: without them few restarts beside other work come to a torque."""
SHARES, RESTARTS, CALM, REACHED = (0.5, 0.1), 10, 10.0, 3.0
"""late_share, its default and one that a busy machine reaches; s before a fault is cleared, and at torque."""
START = {"autostart": "true", "resume": "true", "allow_no_position_limit": "true"}
TRIES = 3
"""Of a quiet trial in which the wire itself lost the replies."""
MEASURED, ATTEMPTS = 3, 8
"""Faults by lateness to measure, and attempts for each."""
BURN = "while True: pass"


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


def controller(args: argparse.Namespace, folder: Path) -> list[tuple[str, str, str]]:
    """Try every rate, quiet and loaded."""
    _join_domain()
    rows = []
    for rate in args.rate:
        for priority in filter(may_have, args.priority):
            for bench, load in ((LOCKED, 0), (FREE, 0), (LOCKED, os.cpu_count() or 1)):
                place = folder / f"{bench.name}{rate:g}-{load}-{priority}"
                rows += _try(bench, rate, load, priority, place)
        rows.append(_lateness_fault(rate, max(filter(may_have, args.priority)), folder))
    rclpy.shutdown()
    return rows


def _join_domain() -> None:
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init()


def restarts(args: argparse.Namespace, folder: Path) -> Iterator[tuple[str, str, str]]:
    """Start the controller anew under 10 N·m beside processes that burn every core: torque at the motor."""
    _join_domain()
    for share in SHARES:
        outside = Outside()
        with ExitStack() as kept:
            bench = kept.enter_context(RemoteBench(folder / f"restarts{share}"))
            bench.hurry()
            kept.enter_context(hurried_wire(49))
            parameters = {**bench.parameters(), "baud": 4_000_000, **START, **PATIENT}
            kept.enter_context(run_node_process("driver", 0, **parameters))
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
        now = time.monotonic()
        if not reached and outside.wrenches and abs(outside.wrenches[-1][1] - 10.0) < 1.0:
            reached, end = True, now + REACHED
        if not reached and now > clear:
            clear = now + CALM
            for name in ("driver", "controller"):
                _call(outside, Trigger, f"{name}/clear_fault", Trigger.Request())
        return now > end

    with run_node_process("controller", 0, late_share=share):
        hold(outside, is_over)
    unit = TABLES[54024].ampere * 6.826
    peaks = [abs(goal) * unit for _, goal, on in bench.log(since)["torque"] if on]
    return max(peaks, default=0.0), reached


def _try(kind: Kind, rate: float, load: int, priority: int, path: Path) -> list[tuple[str, str, str]]:
    """Run one trial; again where the driver lost replies while nothing ran beside it that should, and the
    wire alone makes such faults: that is no answer to what is asked."""
    for again in range(TRIES):
        trial = _trial(kind, rate, load, priority, path.with_name(f"{path.name}-{again}"))
        if load or not trial.lost or not trial.wire_faults:
            break
    beside = f"beside {load} that burn" if load else "quiet"
    name = f"{kind.name}, {rate:g} Hz, {beside}"
    name += (f", FIFO {priority}" if priority else "")
    done = f"; done {again} times before: the wire alone makes such faults" if again else ""
    return [
        (f"{name}: error", f"≤ {kind.asked:g} %" if not load else "", trial.told + done),
        (f"{name}: largest |ft|", f"≤ {1.3 * kind.amplitude:.3g} N·m", f"{trial.largest:.2f} N·m"),
        (f"{name}: the two requests alone, {ALONE:g} s", "", trial.alone),
    ]


def _trial(kind: Kind, rate: float, load: int, priority: int, path: Path) -> Trial:
    """Run one trial once; a fault ends the sine, which is part of the requirement."""
    outside = Outside()
    with ExitStack() as kept, ExitStack() as nodes:
        bench = kept.enter_context(RemoteBench(path, "--rig", kind.rig))
        bench.hurry(priority + 1 if priority else 50)
        kept.enter_context(hurried_wire(priority and priority - 1))
        first, last = _processors(priority)
        parameters = {**bench.parameters(), "baud": 4_000_000, **START, "rig": kind.rig}
        both = {"rate": rate, "realtime_priority": priority}
        parameters.update(both, cpu_affinity=first)
        nodes.enter_context(run_node_process("driver", 0, **parameters))
        nodes.enter_context(run_node_process("controller", 0, cpu_affinity=last, rig=kind.rig, **both))
        outside.until(lambda: outside.wrenches and len(outside.commands) > 50)
        kept.enter_context(burn_cores(load))
        late = _lateness(rate)
        _drive(outside)
        begun = time.monotonic_ns()
        errors = sine(outside, kind.amplitude, rate)
        largest, faults = max(abs(torque) for _, torque, _ in outside.wrenches), _faults(outside)
        stood = bench.stood_still(begun)  # asked first: the bench stands still while it writes its log
        acting = sum(goal != 0 and on for _, goal, on in bench.log(begun)["torque"])
        nodes.close()
        wire_faults, alone = wire_alone(rate, priority, path.parent, bench)
    outside.node.destroy_node()
    health = outside.health.get("controller", {})
    share, missed = health.get("feedback_share"), health.get("missed_measurements")
    told = _errors(errors)
    told += f", {acting} writes of torque, feedback at the end {share}, {health.get('late_commands')} late"
    told += f", {missed} measurements missed, faults {faults or 'none'}"
    told += f", bare loop late in {late:.1%} of its cycles, the bench itself stood still for {stood:.1f} ms"
    lost = any(fault.startswith("no_reply") for fault in faults)
    return Trial(told, largest, lost, wire_faults, alone)


def _processors(priority: int) -> tuple[int, int]:
    """Return the processors of driver and controller: one each at SCHED_FIFO, any (-1) without priority."""
    allowed = os.sched_getaffinity(0)
    return (min(allowed), max(allowed)) if priority else (-1, -1)


def _errors(errors: Sequence[float]) -> str:
    """Return the errors of the periods of a sine, in words; none is left where the torque or ft was lost."""
    if not errors:
        return "no whole period was driven"
    return f"median of periods {100.0 * median(errors):.2f} %, worst {100.0 * max(errors):.1f} %"


def _lateness_fault(rate: float, priority: int, folder: Path) -> tuple[str, str, str]:
    """Measure the time from the fault that lateness latches to zero torque, some times over."""
    outside, place = Outside(), folder / f"late{rate:g}"
    place.mkdir()
    torques = Torques(outside)
    with ExitStack() as kept:
        parameters = {"rate": rate, **START, "realtime_priority": priority}
        kept.enter_context(run_node_process("driver", 0, **parameters))
        process, file = kept.enter_context(noted_controller(place, rate, realtime_priority=priority))
        outside.until(lambda: outside.wrenches and len(outside.commands) > 50)
        runs: list[tuple[str, str]] = []
        while sum(run[0].isdigit() for run in runs) < MEASURED and len(runs) < ATTEMPTS:
            _drive(outside)
            runs.append(to_zero(outside, torques, process, file))
    outside.node.destroy_node()
    return row(f"{rate:g} Hz, controller held up", runs)


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
