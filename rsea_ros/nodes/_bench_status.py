"""What keeps a bench from acting on commands, as its driver says on /diagnostics: a fault, no activation."""

from __future__ import annotations

import time

from rclpy.node import Node

from msg_adapters.ros import DiagnosticArray, DiagnosticStatus, JointState
from rsea_ros.errors import DeviceError
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

PATIENCE = 1.5
"""s from the first measurement on in which a bench reports its status; a driver does once a second."""


class BenchStatus:
    """The status of the node that publishes joint_states, of one of its joints where it has several.

    idle: why commands would have no effect now though nothing is wrong, or nothing.
    """

    def __init__(self, node: Node, joint: str) -> None:
        self._node, self._joint = node, joint
        self._topic = node.resolve_topic_name("joint_states")
        self._heard, self._measured, self._fault, self.idle = False, 0.0, "", ""
        self._states = node.create_subscription(JointState, "joint_states", self._on_state, MEASUREMENT)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, COMMAND)

    def ready(self) -> bool:
        """Return whether commands may begin."""
        known = self._heard or (self._measured and time.monotonic() - self._measured > PATIENCE)
        return bool(known) and not self._fault and not self.idle

    def check(self, *, playing: bool) -> None:
        """Raise DeviceError for a fault, and for a driver that lost its activation under way."""
        if self._fault:
            raise DeviceError(self._fault)
        if playing and self.idle:
            raise DeviceError(self.idle)

    def _on_state(self, message: JointState) -> None:
        self._measured = time.monotonic()
        self._node.destroy_subscription(self._states)

    def _on_health(self, message: DiagnosticArray) -> None:
        benches = self._benches()
        for status in message.status:
            for bench in benches:
                if status.name in (bench, f"{bench}/{self._joint}"):
                    self._see(status, bench)

    def _see(self, status: DiagnosticStatus, bench: str) -> None:
        """Keep a status. bench: the node."""
        values = {pair.key: pair.value for pair in status.values}
        fault, active = values.get("fault", "none"), values.get("active", "True") == "True"
        self._heard, self._fault = True, ""
        if fault != "none":
            self._fault = f"{status.name} has latched a fault, {fault}; rsea call {bench} clear_fault"
        self.idle = "" if active else f"{status.name} is not active; rsea call {bench} activate"

    def _benches(self) -> set[str]:
        infos = self._node.get_publishers_info_by_topic(self._topic)
        return {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
