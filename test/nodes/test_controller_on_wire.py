"""Controller and driver together on a simulated bench, with the defaults of config/nodes."""

import signal
import time

import numpy as np
import pytest

from msg_adapters.ros import (
    DiagnosticArray,
    JointState,
    WrenchStamped,
    torque_command_message,
)
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from test.nodes.on_wire import newest_status, value_in
from test.nodes.torque_loop import GAINS
from test.nodes.warm import Bench

RATE, ERROR_LIMIT, ERROR_TIME, FT_LIMIT = 280.0, 15.0, 0.5, 110.0
"""Of config/nodes/controller.yaml: Hz, N m, s, N m."""


class Wire:
    """Both nodes, and what they say."""

    def __init__(self, bench, start, listener):
        self.bench, self.listener = bench, listener
        spaces = {"__ns": "/wired"}
        started = {"autostart": True, "resume": True, "baud": 4_000_000}
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self.controller = start("controller", remaps=spaces)
        listener.until(lambda: self.status("controller"))  # it designs its gains: nothing need run meanwhile
        self.driver = start("driver", remaps=spaces, **bench.parameters(), **started)
        self.wrenches = listener.hear(WrenchStamped, "/wired/ft", MEASUREMENT)
        self.desired = listener.node.create_publisher(JointState, "/wired/desired_torque", COMMAND)

    def status(self, name):
        """The newest status of a node: level, message, values."""
        return newest_status(self.health, f"/wired/{name}")

    def clear(self, name):
        """Call clear_fault of a node."""
        return self.listener.call(f"/wired/{name}/clear_fault")

    def clear_latched(self):
        """Clear whichever node has a fault."""
        for name in ("driver", "controller"):
            status = self.status(name)
            if status is not None and status.level == b"\x02":
                self.clear(name)

    def hold(self, torque, condition):
        """Request a torque until a condition holds; clear faults from stalls of the machine."""
        command = lambda: self.desired.publish(torque_command_message(time.time_ns(), torque))  # noqa: E731
        self.listener.until(condition, command, self.clear_latched)


@pytest.fixture(scope="module")
def wire(tmp_path_factory, start, listener):
    """The bench, the driver and the controller."""
    with Bench(tmp_path_factory.mktemp("wired") / "tty") as bench:
        made = Wire(bench, start, listener)
        listener.until(lambda: made.status("driver") and made.status("controller") and made.wrenches)
        yield made


def test_the_controller_runs_on_the_drivers_measurements_and_reaches_the_torque(wire):
    """It divided by zero at the first late cycle that was followed by one in time."""
    wire.hold(10.0, lambda: abs(wire.wrenches[-1].wrench.torque.z - 10.0) < 1.0)
    heard = len(wire.wrenches)
    wire.hold(10.0, lambda: len(wire.wrenches) > heard + 420)
    assert wire.controller.is_running() and wire.driver.is_running()
    wire.hold(10.0, lambda: abs(wire.wrenches[-1].wrench.torque.z - 10.0) < 1.0)


def test_the_controller_never_becomes_unstable(wire):
    """A machine that stalls lets a torque overshoot; none stays off by more than error_limit for error_time.

    In half a second of late commands at the limit nearly every sample was off, to 102 N m.
    """
    off = [abs(message.wrench.torque.z - 10.0) > ERROR_LIMIT for message in wire.wrenches]
    window = round(2 * ERROR_TIME * RATE)
    counts = np.convolve(off, np.ones(window), "valid")
    assert len(off) > 420 and counts.max() <= 0.5 * window + 0.1 * RATE
    assert max(abs(message.wrench.torque.z) for message in wire.wrenches) < FT_LIMIT


def test_the_end_of_the_controller_is_that_of_the_torque_and_another_one_begins_softly(wire, start, listener):
    """It was 15 to 47 N m at the motor for 10 N m: a limit that grows slowly let the whole error in."""
    wire.controller.kill()
    listener.until(lambda: wire.bench.torque()[0] == 0 and abs(wire.wrenches[-1].wrench.torque.z) < 1.0)
    assert wire.driver.is_running()
    since = wire.bench.ask("torque")["t"]
    wire.health.clear()
    wire.controller = start("controller", remaps={"__ns": "/wired"}, **GAINS)
    wire.hold(10.0, lambda: abs(wire.wrenches[-1].wrench.torque.z - 10.0) < 0.5)
    heard = len(wire.wrenches)
    wire.hold(10.0, lambda: len(wire.wrenches) > heard + 200)
    log = wire.bench.log(since)["torque"]
    goals = [abs(goal) * TABLES[54024].ampere * 6.826 for _, goal, on in log if on]
    assert max(goals) < 12.0
    late, commands = (value_in(wire.status("controller"), key) for key in ("late_commands", "commands"))
    assert int(late) < 0.5 * int(commands)


@pytest.mark.parametrize("ft", [False, True])
def test_what_is_mounted_the_other_way_round_is_a_fault_after_small_pulses(wire, ft):
    """The controller ran away to 68 N m at the motor before anybody had wished for a torque."""
    wire.clear("controller")
    wire.listener.until(lambda: wire.bench.torque()[0] == 0)
    since = wire.bench.ask("reverse", ft=ft)["t"]
    wire.health.clear()
    signs = "signs: ft is reversed; ft, joint_states and motor torque contradict each other"
    wire.hold(10.0, lambda: any(m.status[0].message.startswith(signs) for m in wire.health))
    wire.bench.ask("reverse", ft=ft)
    goals = [abs(goal) for _, goal, on in wire.bench.log(since)["torque"] if on]
    assert 0.0 < max(goals) * TABLES[54024].ampere * 6.826 < 5.0


def test_the_hangup_of_a_terminal_ends_the_driver_at_zero(wire):
    assert wire.driver.stop(signal.SIGHUP) == 0
    assert wire.bench.torque() == (0, False)
