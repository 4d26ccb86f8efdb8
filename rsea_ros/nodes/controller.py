"""controller: makes the distal torque follow desired_torque, with every load from locked to free."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.subscription import Subscription

from msg_adapters.ros import (
    JointState,
    Trigger,
    WrenchStamped,
    effort_of,
    joint_state_of,
    torque_command_message,
    wrench_of,
)
from rsea_ros.control.controller import Reading
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._bench import Polled
from rsea_ros.nodes._commands import CommandQueue
from rsea_ros.nodes._control import TABLE, controller_of, design_of, summary
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._health import ERROR, OK, WARN, Health, Report
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.nodes._run import run_node

WATCH = 0.005
"""s between two looks at the age of the last measurement."""

CLOSING_ZEROS = 3
LATEST = 1.0
"""Samples by which a command may come late and still be feedback: what the least delay margin is made for."""

WAITING = 500
"""Measurements that wait for their other half."""


class Controller:
    """One command for each measurement, stamped with the instant of the next: one sample of delay, always."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        self._design = design_of(values)
        self._controller = controller_of(values, self._design)
        self._period = SECOND / values["rate"]
        self._desired = CommandQueue()
        self._states: deque[tuple[int, float, float, float]] = deque(maxlen=WAITING)
        self._fts: deque[tuple[int, float]] = deque(maxlen=WAITING)
        self._last, self._heard, self._fault, self._torque, self._fall = 0, 0, "", 0.0, 0.0
        self._steps = self._missed = self._unusable = self._limited = self._late = self._told = 0
        self._squares: list[float] = []
        self._commands = node.create_publisher(JointState, "torque_command", COMMAND)
        subscribe = node.create_subscription
        self._on = {
            "joint_states": subscribe(JointState, "joint_states", self._on_state, MEASUREMENT),
            "ft": subscribe(WrenchStamped, "ft", self._on_ft, MEASUREMENT),
            "desired_torque": subscribe(
                JointState, "desired_torque", lambda message: None, COMMAND, callback_group=Polled()
            ),
        }
        node.create_service(Trigger, "~/clear_fault", self._clear)
        node.create_timer(WATCH, self._watch)
        self._health = Health(node, self._report)
        for line in summary(self._design):
            node.get_logger().info(line)

    def _on_state(self, message: JointState) -> None:
        self._states.append(joint_state_of(message))
        self._pair()

    def _on_ft(self, message: WrenchStamped) -> None:
        """Take what else has arrived as well, so that a process that was held up has the newest at once."""
        self._fts.append(wrench_of(message, self._values["axis"]))
        for waiting, _ in _waiting(self._on["joint_states"], JointState):
            self._states.append(joint_state_of(waiting))
        for waiting, _ in _waiting(self._on["ft"], WrenchStamped):
            self._fts.append(wrench_of(waiting, self._values["axis"]))
        self._pair()

    def _pair(self) -> None:
        """Command for each state that has the torque of its instant, to half a period, or of a later one."""
        while self._states and self._fts:
            stamp, position, velocity, effort = self._states[0]
            if self._fts[0][0] < stamp - 0.5 * self._period:
                self._fts.popleft()
                continue
            self._states.popleft()
            reading = Reading(self._fts[0][1], velocity, position, effort)
            usable = math.isfinite(reading.ft + velocity + position)
            self._unusable += not usable
            if usable and stamp > self._last and not self._fault:
                self._command(stamp, reading)

    def _command(self, stamp: int, reading: Reading) -> None:
        missed = round((stamp - self._last) / self._period) - 1 if self._last else 0
        self._poll()
        self._desired.take(stamp + round((2.5 if self._values["preview"] else 0.5) * self._period))
        if not self._last:
            self._controller.start(reading, self._desired.torque)
        late = time.time_ns() - stamp > (1.0 + LATEST) * self._period
        self._torque = self._controller.step(reading, self._desired.torque, missed, late=late)
        self._commands.publish(torque_command_message(stamp + round(self._period), self._torque))
        self._last, self._heard = stamp, time.monotonic_ns()
        self._steps, self._missed = self._steps + 1, self._missed + missed
        self._limited += self._controller.share.limited
        self._late += late
        self._squares.append((reading.ft - self._desired.torque) ** 2)

    def _poll(self) -> None:
        """Put all desired torques that have arrived into the queue."""
        for message, received in _waiting(self._on["desired_torque"], JointState):
            try:
                self._desired.add(*effort_of(message), received)
            except ParameterError as error:
                self._desired.refused += 1
                self._node.get_logger().error(f"desired_torque: {error}", throttle_duration_sec=1.0)

    def _watch(self) -> None:
        """Latch a fault when measurements cease, and take the torque to zero."""
        age = (time.monotonic_ns() - self._heard) / SECOND
        if self._last and not self._fault and age > self._values["stale"]:
            limit = 1e3 * self._values["stale"]
            self._fault = f"no usable measurement for {1e3 * age:.0f} ms, expected one within {limit:.0f} ms"
            self._node.get_logger().error(f"{self._fault}; torque zero until clear_fault")
            self._health.publish()
            self._fall = abs(self._torque) * WATCH / max(self._values["release"], WATCH)
        if self._fault:
            self._torque = math.copysign(max(0.0, abs(self._torque) - self._fall), self._torque)
            self._commands.publish(torque_command_message(time.time_ns(), self._torque))

    def _clear(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Begin anew, at zero torque, with the next measurement."""
        self._fault, self._last, self._torque = "", 0, 0.0
        self._desired.clear()
        response.success, response.message = True, "clear_fault: done"
        return response

    def finished(self) -> bool:
        """Run until stopped."""
        return False

    def conclude(self) -> None:
        """Leave nothing to do: `close` commands the zeros."""

    def close(self) -> None:
        """Command zero torque, and wait until that has arrived."""
        after = max(self._last + round(self._period), time.time_ns())
        for k in range(1, CLOSING_ZEROS + 1 if self._last else 1):
            self._commands.publish(torque_command_message(after + round(k * self._period), 0.0))
        self._commands.wait_for_all_acked(Duration(seconds=0, nanoseconds=SECOND // 5))
        self._node.get_logger().info(f"torque zero after {self._steps} commands")

    def _report(self) -> Report:
        squares, self._squares = self._squares, []
        worst = min(self._design.margins.values(), key=lambda m: m.phase)
        share = self._controller.share
        values = {
            "desired": f"{self._desired.torque:.3f}",
            "torque_command": f"{self._torque:.3f}",
            "error_rms": f"{math.sqrt(sum(squares) / len(squares)):.4f}" if squares else "none",
            "disturbance_and_error": f"{share.feedback:.3f}",
            "compensation": f"{share.compensation:.3f}",
            "commands": self._steps,
            "missed_measurements": self._missed,
            "unusable_measurements": self._unusable,
            "limited_commands": self._limited,
            "late_commands": self._late,
            "crossover_hz": f"{self._design.margins['locked'].crossover:.2f}",
            "phase_margin_deg": f"{worst.phase:.1f}",
            "gain_margin_db": f"{worst.gain:.1f}",
            "delay_margin_samples": f"{worst.delay:.2f}",
            "desired_watchdog_trips": self._desired.expired,
            "refused_desired": self._desired.refused,
        }
        if self._fault:
            return Report(ERROR, self._fault, values)
        if not self._last:
            return Report(WARN, "waiting for joint_states and ft", values)
        new, self._told = self._late - self._told, self._late
        if new:
            return Report(WARN, f"{new} commands more than a sample late, without feedback", values)
        return Report(OK, "running", values)


def _waiting(subscription: Subscription[Any], kind: Any) -> Iterator[tuple[Any, int]]:
    """Yield the messages that wait, with the instant of arrival, ns."""
    handle = subscription.handle
    with handle:
        while (taken := handle.take_message(kind, False)) is not None:
            yield taken[0], taken[1]["received_timestamp"]


def main() -> int:
    """Run the node."""
    return run_node("controller", TABLE, Controller)


if __name__ == "__main__":
    sys.exit(main())
