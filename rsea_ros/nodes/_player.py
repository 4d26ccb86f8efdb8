"""Plays a command on torque_command, on the grid of the measurements' stamps, and ends with zeros.

A live run is played and recorded, and valid only without a failure.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher

from msg_adapters import ros
from rsea_ros.errors import DeviceError, RseaError
from rsea_ros.experiment.joint_weighing import SHORTEST
from rsea_ros.nodes._cycle import SECOND, Cycle, on_grid
from rsea_ros.nodes._drive import REST
from rsea_ros.nodes._qos import COMMAND, DISCOVERY_TIME, MEASUREMENT, await_arrival, publishers_of
from rsea_ros.nodes._tap import Ears
from rsea_ros.records.record import FloatArray, Record

CLOSING_ZEROS = 3
MARGIN = SECOND // 100
"""A command that has less than this left until it takes effect is left out: its stamp would not be true."""
SOFT = 0.1
"""s in which a run that is stopped goes to zero torque, under a raised cosine."""
PATIENCE = 1.5
"""s from the first measurement on in which a bench reports its status; a driver does once a second."""


class BenchStatus:
    """The status of the node that publishes joint_states, of one of its joints where it has several.

    idle: why commands would have no effect now though nothing is wrong, or nothing. zero_first: whether a
    rest must come before torque. largest: N m, of the commands; a driver that limits them below that is a
    fault of the run.
    """

    def __init__(self, node: Node, joint: str, largest: float = 0.0) -> None:
        self._node, self._joint, self.largest = node, joint, largest
        self._heard, self._measured, self._latched, self.idle, self.zero_first = False, 0.0, "", "", False
        self._most = math.inf, ""
        self._states = node.create_subscription(ros.JointState, "joint_states", self._on_state, MEASUREMENT)
        node.create_subscription(ros.DiagnosticArray, "/diagnostics", self._on_health, COMMAND)

    @property
    def fault(self) -> str:
        """What is wrong, in words; empty where nothing is known to be."""
        limit, who = self._most
        if self._latched or not self.largest > limit:
            return self._latched
        most = f"expected at most torque_limit = {limit:.4g} N·m of {who}"
        return f"largest command {self.largest:.4g} N·m, {most}"

    def ready(self) -> bool:
        """Return whether commands may begin."""
        known = self._heard or (self._measured and time.monotonic() - self._measured > PATIENCE)
        return bool(known) and not self.fault and not self.idle

    def check(self, *, playing: bool) -> None:
        """Raise DeviceError for a fault, and for a driver that lost its activation under way."""
        if why := self.fault or (playing and self.idle):
            raise DeviceError(why)

    def _on_state(self, message: ros.JointState) -> None:
        self._measured = time.monotonic()
        self._node.destroy_subscription(self._states)

    def _on_health(self, message: ros.DiagnosticArray) -> None:
        benches = publishers_of(self._node, "joint_states")
        for status in message.status:
            for bench in benches:
                if status.name in (bench, f"{bench}/{self._joint}"):
                    self._see(status, bench)

    def _see(self, status: ros.DiagnosticStatus, bench: str) -> None:
        """Keep a status. bench: the node."""
        values = {pair.key: pair.value for pair in status.values}
        fault, active = values.get("fault", "none"), values.get("active", "True") == "True"
        self._heard, self.zero_first = True, values.get("zero_first") == "True"
        self._most = float(values.get("torque_limit", math.inf)), status.name
        latched = f"{status.name} has latched a fault, {fault}; rsea call {bench} clear_fault"
        self._latched = latched if fault != "none" else ""
        self.idle = "" if active else f"{status.name} is not active; rsea call {bench} activate"


class Player:
    """Publishes one command (N m, at `rate` Hz), each value `lead` s before it takes effect.

    bench: says whether it may begin, and whether a driver with autostart wants to see that nobody was under
    way. wanted: subscriptions of torque_command to wait for. publisher: of a node that plays more than once.
    next: values that are out. left_out: values that came too late. rests: it rests, or has.
    """

    def __init__(
        self, node: Node, command: FloatArray, rate: float, bench: BenchStatus, *, lead: float, wanted: int,
        joint: str, publisher: Publisher[ros.JointState] | None = None,
    ) -> None:  # fmt: skip
        self.command, self.rate = command, rate
        self.next, self.left_out, self.started, self.rests = 0, 0, False, False
        self._node, self._lead, self._wanted, self._joint = node, round(lead * SECOND), wanted, joint
        self._stamp, self._last, self.bench, self._zero, self._stopped_at = 0, 0.0, bench, 0.0, -1
        self._publisher = publisher or node.create_publisher(ros.JointState, "torque_command", COMMAND)
        states = ros.JointState, "joint_states", self._begin, MEASUREMENT
        self._measurements = node.create_subscription(*states)
        self.cycle = Cycle(rate, self._step, catch_up=True)

    @property
    def subscriptions(self) -> int:
        """How many listen to the commands."""
        return self._publisher.get_subscription_count()

    def stop(self) -> None:
        """Go to zero within SOFT s from the value that comes next; the run is over then."""
        if self._stopped_at < 0:
            self._stopped_at = self.next

    @property
    def stopped(self) -> bool:
        """Whether a stop was requested."""
        return self._stopped_at >= 0

    def over(self) -> bool:
        """Return whether everything is published. Raises the error of the thread."""
        if self.started:
            self.cycle.is_running()
        soft = self._stopped_at + round(SOFT * self.rate) if self.stopped else len(self.command)
        return self.next >= min(soft, len(self.command)) or (self.stopped and not self.started)

    def close(self) -> None:
        """Go softly to zero, command zero torque after the last command, and wait until that has arrived."""
        if not self.started:
            self._node.destroy_subscription(self._measurements)
        deadline = time.monotonic() + 2.0 * SOFT
        if self.started and self.next < len(self.command):
            self.stop()
        while self.started and self.cycle.error is None and time.monotonic() < deadline and not self.over():
            time.sleep(0.005)
        self.cycle.stop()
        last = max(self._stamp, time.time_ns())
        for k in range(1, CLOSING_ZEROS + 1 if self.started else 1):
            stamp = last + round(k * SECOND / self.rate)
            self._publisher.publish(ros.torque_command_message(stamp, 0.0, self._joint))
        await_arrival(self._publisher)

    def _begin(self, message: ros.JointState) -> None:
        """Start at a whole number of periods after a measurement, once all subscribers listen."""
        if self.started or self.stopped or self.subscriptions < self._wanted or not self.bench.ready():
            return
        if self.bench.zero_first and not self._zero:
            self._zero, self.rests = time.monotonic(), True
            self._publisher.publish(ros.torque_command_message(time.time_ns(), 0.0, self._joint))
        if self._zero and time.monotonic() < self._zero + 1.2 * REST:
            return
        self.started = True
        earliest = time.time_ns() + self._lead + DISCOVERY_TIME
        self.cycle.start(on_grid(earliest, ros.stamp_of(message.header.stamp), self.rate) - self._lead)
        self._node.destroy_subscription(self._measurements)

    def _step(self, now: int) -> None:
        """Publish the next command, or leave it out when this thread was held up for too long."""
        k, self.next = self.next, self.next + 1
        torque = self._torque(k)
        self._stamp = now + self._lead
        if self._lead and self._stamp - time.time_ns() < min(MARGIN, self._lead // 2):
            self.left_out += 1
        else:
            self._publisher.publish(ros.torque_command_message(self._stamp, torque, self._joint))

    def _torque(self, k: int) -> float:
        """Return the command of cycle k: as planned; after a stop the last one, decreasing to zero."""
        if not self.stopped:
            self._last = float(self.command[k]) if k < len(self.command) else 0.0
            return self._last
        done = (k - self._stopped_at + 1) / (SOFT * self.rate)
        return self._last * 0.5 * (1.0 + float(np.cos(np.pi * min(done, 1.0))))


BROKEN = {"commands_left_out", "late_commands", "lost_messages", "watchdog_trips"}
"""Faults of a record that say that its commands did not act as planned."""
SILENT = 0.3
"""s without a measurement after which a run is stopped: nobody knows what the bench does."""
FOLLOWED = 0.5
"""RMS of measured less commanded torque, of the command's, above which the motor did not follow."""
_TAIL = 0.5
"""s that is heard after the last command, beside what makes the record long enough for a diagnosis."""


class BenchEars:
    """The topics of a node's bench, with a new record for each run."""

    def __init__(self, node: Node, axis: str) -> None:
        self._alarm: Callable[[str], None] = lambda why: None
        self.last = time.monotonic()
        self._failed: set[str] = set()
        self._ears = Ears(node, axis, {"torque_command"}, self._heard)
        self._health = node.create_subscription(ros.DiagnosticArray, "/diagnostics", self._on_health, COMMAND)

    def begin(self, alarm: Callable[[str], None]) -> None:
        """Start a new record. alarm: called when a node of the bench has failed."""
        self._ears.begin()
        self._alarm, self.last = alarm, time.monotonic()

    def end(self) -> None:
        """End the record, in the executor's thread: what is heard later is not read while it grows."""
        self._run = self._ears.take()

    def record(self) -> Record:
        """Return the record that has ended. Raises RseaError where none can be made."""
        return self._ears.record(strict=False, contents=self._run)

    def _heard(self, role: str) -> None:
        if role != "torque_command":
            self.last = time.monotonic()

    def _on_health(self, message: ros.DiagnosticArray) -> None:
        """Raise the alarm for failures after the beginning of the run only."""
        for status in message.status:
            if status.level != ros.ERROR:
                self._failed.discard(status.name)
            elif status.name not in self._failed:
                self._failed.add(status.name)
                self._alarm(f"{status.name}: {status.message}")


class LiveRun:
    """Plays a proposal while its bench is recorded; a run that broke off is discarded."""

    def __init__(self, ears: BenchEars, player: Player) -> None:
        self._ears, self._player = ears, player
        self._over_at, self._why, self._begun = 0.0, "", time.monotonic()
        self._rest = max(_TAIL, SHORTEST + _TAIL - len(player.command) / player.rate)
        ears.begin(self._fail)

    def stop(self, why: str) -> None:
        """Go softly to zero; the run counts for nothing. why: the first reason stays."""
        self._why = self._why or why
        self._player.stop()

    def waits(self) -> float:
        """Return for how long it has waited for its bench, s; 0 once that heard of it."""
        return 0.0 if self._player.started or self._player.rests else time.monotonic() - self._begun

    def over(self) -> bool:
        """Return whether the run and its recording are over; stops it where the bench falls silent."""
        if not self._player.started and (fault := self._player.bench.fault):
            self.stop(fault)
        silent = time.monotonic() - self._ears.last
        if self._player.started and silent > SILENT:
            self.stop(f"no measurement for {silent:.2f} s")
        if not self._player.over():
            return False
        self._over_at = self._over_at or time.monotonic()
        return bool(self._why) or time.monotonic() - self._over_at > self._rest

    def close(self) -> None:
        """Command zero torque; the record is over."""
        self._player.close()
        self._ears.end()

    def record(self) -> Record:
        """Return the record. Raises DeviceError for a run that broke off."""
        if self._why:
            raise DeviceError(self._why)
        try:
            record = self._ears.record()
        except RseaError as error:
            raise DeviceError(f"the run left no record: {error}") from None
        if self._player.left_out:
            raise DeviceError(f"{self._player.left_out} commands came too late on this machine")
        for fault in record.faults:
            if fault.kind in BROKEN:
                raise DeviceError(f"{fault.kind} {fault.detail}".strip())
        check_followed(record)
        return record

    def _fail(self, why: str) -> None:
        """Stop when a node of the bench reports a failure."""
        if self._player.started:
            self.stop(why)


def check_followed(record: Record) -> None:
    """Raise DeviceError where the measured motor torque is not the commanded one, as after a trip."""
    if "motor_torque" not in record:
        return
    command, measured = record["command"], record["motor_torque"]
    asked = np.interp(measured.t - 0.5 / command.rate, command.t, command.y, left=0.0, right=0.0)
    size = float(np.sqrt(np.mean(asked**2)))
    away = float(np.sqrt(np.mean((measured.y - asked) ** 2)))
    if away > FOLLOWED * size + 0.2:
        raise DeviceError(f"the motor torque was {away:.3g} N·m RMS off the command of {size:.3g} N·m")
