"""One joint_states of all joints of a driver, as robot_state_publisher and ros2_control read them."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.node import Node
from rclpy.serialization import serialize_message

from msg_adapters.raw import RawWriter
from msg_adapters.ros import JointState, joint_states_message
from msg_adapters.topic_map import TYPES
from rsea_ros.hardware.device import State
from rsea_ros.nodes._qos import MEASURED, OVERRIDES


class Combined:
    """The topic `joint_states` of the node beside those of its joints. names: of all joints, in order."""

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        self._node = node
        self._publisher = node.create_publisher(
            JointState, "joint_states", MEASURED, qos_overriding_options=OVERRIDES
        )
        template = serialize_message(joint_states_message(names))
        self._writer = RawWriter(template, TYPES["joint_states"], "position", "velocity", "effort")

    def publish(self, states: Sequence[State | None], shift: int) -> None:
        """Publish the readings of a cycle under the first one's stamp; nothing where one is lost.

        shift: ns, of the stamps.
        """
        read = [state for state in states if state is not None]
        if len(read) < len(states):
            return
        numbers = [state.position for state in read] + [state.velocity for state in read]
        numbers += [state.motor_torque for state in read]
        self._publisher.publish(self._writer.write(read[0].stamp + shift, numbers))

    def close(self) -> None:
        """Take the topic away."""
        self._node.destroy_publisher(self._publisher)
