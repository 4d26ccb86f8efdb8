"""The flag of the model node: as a bare truth, and with the stamp of the sample that changed it."""

from __future__ import annotations

from rclpy.node import Node

from msg_adapters.ros import Bool, JointState, bool_message, efforts_message
from rsea_ros.nodes._qos import LATCHED, await_arrival

NAME = "pure_torque"


class Flags:
    """`pure_torque` (Bool) and `pure_torque_stamped` (JointState: effort[0] is 1 or 0), both latched."""

    def __init__(self, node: Node) -> None:
        self._bare = node.create_publisher(Bool, NAME, LATCHED)
        self._stamped = node.create_publisher(JointState, f"{NAME}_stamped", LATCHED)
        self._up, self._stamp = False, 0
        self._publish()

    def show(self, stamp: int, up: bool) -> None:
        """Publish the flag from a sample (its stamp in ns) on, if it has changed."""
        self._stamp = stamp
        if up != self._up:
            self._up = up
            self._publish()

    def lower(self) -> None:
        """Lower the flag, and wait until all subscribers have it."""
        self._up = False
        self._publish()
        for publisher in (self._bare, self._stamped):
            await_arrival(publisher)

    def _publish(self) -> None:
        self._bare.publish(bool_message(self._up))
        self._stamped.publish(efforts_message(self._stamp, {NAME: float(self._up)}))
