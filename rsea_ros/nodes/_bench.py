"""The topics of a bench, which plant and driver share: measurements out, commands in."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.serialization import serialize_message

from msg_adapters.raw import RawWriter
from msg_adapters.ros import JointState, WrenchStamped, joint_state_message, wrench_message
from msg_adapters.topics import JOINT_STATE, TYPES
from rsea_ros.hardware.device import State
from rsea_ros.nodes._commands import CommandQueue
from rsea_ros.nodes._cycle import Cycle
from rsea_ros.nodes._health import OK, WARN, Report
from rsea_ros.nodes._mailbox import Mailbox
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT


class Bench:
    """Publishes readings, and puts what comes on `torque_command` into a queue.

    Messages are serialised ones with the numbers put in: to make them of Python objects takes 60 us a cycle.
    """

    def __init__(self, node: Node, *, strict: bool = False, every_record: bool = False) -> None:
        """strict: see CommandQueue. every_record: ft gets all that came since the last reading, not one."""
        self._node, self._every_record = node, every_record
        self.commands = CommandQueue(strict=strict)
        self._told = (0, 0, 0)
        self._states = node.create_publisher(JointState, "joint_states", MEASUREMENT)
        self._ft = node.create_publisher(WrenchStamped, "ft", MEASUREMENT)
        self._state_writer = RawWriter(
            serialize_message(joint_state_message(0, 0.0, 0.0, 0.0)), TYPES["joint_states"],
            "position", "velocity", "effort",
        )  # fmt: skip
        wrench = serialize_message(wrench_message(0, (0.0,) * 6))
        self._ft_writer = RawWriter(wrench, TYPES["ft"], "wrench")
        self._wanted = Mailbox(
            node, JOINT_STATE, "torque_command", COMMAND, self.commands.refuse, ("effort", 0)
        )

    def poll(self) -> None:
        """Put all commands that have arrived into the queue."""
        for stamp, (torque,), received in self._wanted.take():
            self.commands.add(stamp, torque, received)

    def publish(self, state: State) -> None:
        """Publish one reading under its stamps."""
        numbers = (state.position, state.velocity, state.motor_torque)
        self._states.publish(self._state_writer.write(state.stamp, numbers))
        if self._every_record:
            for stamp, wrench in state.wrenches:
                self._ft.publish(self._ft_writer.write(stamp, wrench))
        elif state.wrench is not None:
            self._ft.publish(self._ft_writer.write(state.ft_stamp, state.wrench))

    def report(self, cycle: Cycle) -> Report:
        """Return the health of a bench that runs in a cycle; warnings are of what is new since the last."""
        timing, commands = cycle.timing(), self.commands
        counts = (timing.missed, commands.late, commands.refused)
        new = [now - before for now, before in zip(counts, self._told, strict=True)]
        self._told = counts
        kinds = ("cycles missed", "commands late", "commands refused")
        troubles = [f"{count} {kind}" for count, kind in zip(new, kinds, strict=True) if count]
        values = {**timing.values(), "lost_cycles": cycle.left_out, **commands.values(time.time_ns())}
        return Report(WARN if troubles else OK, ", ".join(troubles) or "running", values)

    def close(self) -> None:
        """Take the topics away."""
        for publisher in (self._states, self._ft):
            self._node.destroy_publisher(publisher)
        self._node.destroy_subscription(self._wanted.subscription)
