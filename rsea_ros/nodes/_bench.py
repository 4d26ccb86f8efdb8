"""The topics of a bench, which plant and driver share: measurements out, commands in."""

from __future__ import annotations

import time

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from msg_adapters.ros import JointState, WrenchStamped, effort_of, joint_state_message, wrench_message
from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import State
from rsea_ros.nodes._commands import CommandQueue
from rsea_ros.nodes._cycle import Cycle
from rsea_ros.nodes._health import OK, WARN, Report
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT


class Polled(CallbackGroup):
    """Subscriptions that no executor serves: the cycle takes what has arrived when it needs it."""

    def can_execute(self, entity: object) -> bool:
        """Return False: never by an executor."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return False: never by an executor."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing."""


class Bench:
    """Publishes readings, and puts what comes on `torque_command` into a queue."""

    def __init__(self, node: Node, *, strict: bool = False, every_record: bool = False) -> None:
        """strict: see CommandQueue. every_record: ft gets all that came since the last reading, not one."""
        self._node, self._every_record = node, every_record
        self.commands = CommandQueue(strict=strict)
        self._told = (0, 0, 0)
        self._states = node.create_publisher(JointState, "joint_states", MEASUREMENT)
        self._ft = node.create_publisher(WrenchStamped, "ft", MEASUREMENT)
        self._subscription = node.create_subscription(
            JointState, "torque_command", lambda message: None, COMMAND, callback_group=Polled()
        )

    def poll(self) -> None:
        """Put all commands that have arrived into the queue."""
        handle = self._subscription.handle
        with handle:
            while (waiting := handle.take_message(JointState, False)) is not None:
                message, info = waiting
                self._command(message, info["received_timestamp"])

    def publish(self, state: State) -> None:
        """Publish one reading under its stamps."""
        self._states.publish(
            joint_state_message(state.stamp, state.position, state.velocity, state.motor_torque)
        )
        if self._every_record:
            for stamp, wrench in state.wrenches:
                self._ft.publish(wrench_message(stamp, wrench))
        elif state.wrench is not None:
            self._ft.publish(wrench_message(state.ft_stamp, state.wrench))

    def report(self, cycle: Cycle) -> Report:
        """Return the health of a bench that runs in a cycle; warnings are of what is new since the last."""
        timing, commands = cycle.timing(), self.commands
        counts = (timing.missed, commands.late, commands.refused)
        new = [now - before for now, before in zip(counts, self._told, strict=True)]
        self._told = counts
        kinds = ("cycles missed", "commands late", "commands refused")
        troubles = [f"{count} {kind}" for count, kind in zip(new, kinds, strict=True) if count]
        values = {**timing.values(), **commands.values(time.time_ns())}
        return Report(WARN if troubles else OK, ", ".join(troubles) or "running", values)

    def close(self) -> None:
        """Take the topics away."""
        for publisher in (self._states, self._ft):
            self._node.destroy_publisher(publisher)
        self._node.destroy_subscription(self._subscription)

    def _command(self, message: JointState, received: int) -> None:
        try:
            stamp, torque = effort_of(message)
        except ParameterError as error:
            self.commands.refused += 1
            self._node.get_logger().error(f"torque_command: {error}", throttle_duration_sec=1.0)
            return
        self.commands.add(stamp, torque, received)
