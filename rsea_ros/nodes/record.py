"""record: writes the messages on the topics of a bench into a bag."""

import os
import re
import sys
import time
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.serialization import serialize_message

from msg_adapters import BagWriter
from msg_adapters.ros import GetParameters, ListParameters, message_type, parameters_message
from msg_adapters.topic_map import JOINT_STATE, WRENCH
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, NodeHealth
from rsea_ros.nodes._parameters import NodeParameter
from rsea_ros.nodes._qos import RECORD, RECORD_LATCHED, RECORD_RELIABLE, offered
from rsea_ros.nodes._run import Component
from rsea_ros.nodes._tap import Tap, heard
from rsea_ros.outputs.files import unused_path

TOPICS = {
    "torque_command": JOINT_STATE,
    "joint_states": JOINT_STATE,
    "ft": WRENCH,
    "deflection": JOINT_STATE,
    "torque_estimate": JOINT_STATE,
    "desired_torque": JOINT_STATE,
    "desired_position": JOINT_STATE,
    "pure_torque": "std_msgs/msg/Bool",
    "pure_torque_stamped": JOINT_STATE,
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
}
QOS = dict.fromkeys(("torque_command", "desired_torque", "/parameter_events"), RECORD_RELIABLE)
QOS |= dict.fromkeys(("pure_torque", "pure_torque_stamped"), RECORD_LATCHED)
"""Of the topics that are not heard best effort."""

TABLE = (
    NodeParameter("out", "", "bag to write; empty: runs/ and the time"),
    NodeParameter("storage", "mcap", "format of the bag", choices=("mcap", "sqlite3")),
    NodeParameter(
        "duration", 0.0, "length of the recording from the first message on; 0: until stopped", "s", 0.0, 1e6
    ),
    NodeParameter(
        "sync", 1.0, "what a power cut or a kill may cost: put on the disk so often", "s", 0.1, 60.0
    ),
    NodeParameter(
        "quiet", 0.0, "stop when torque_command has been silent for so long; 0: never", "s", 0.0, 1e4
    ),
)


SERVICES: tuple[tuple[Any, str], ...] = (
    (ListParameters, "list_parameters"), (GetParameters, "get_parameters"),
)  # fmt: skip


def distribution() -> str:
    """Return the distribution of ROS, sourced or of wheels, empty where it is not known."""
    wheels = (re.fullmatch(r"ros[-_](\w+)[-_]rclpy", each.name or "") for each in metadata.distributions())
    return os.environ.get("ROS_DISTRO") or next((found[1] for found in wheels if found), "")


class RecordNode:
    """Subscriptions to every topic, one bag. Log times are those of reception."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._node = node
        self._duration: float = values["duration"]
        self._quiet: float = values["quiet"]
        path = values["out"] or unused_path(Path("runs") / time.strftime("%Y%m%d-%H%M%S"))
        options = {"interval": values["sync"], "distribution": distribution()}
        self._bag = BagWriter(path, values["storage"], **options).__enter__()
        self._taps = {name: self._tap(name, kind) for name, kind in TOPICS.items()}
        self._begin = self._commanded = 0.0
        self._health = Health(node, self._report)
        self._clients: dict[str, list[Any]] = {}
        self._asked = {node.get_fully_qualified_name()}
        node.create_timer(2.0, self._tell, clock=STEADY)
        node.create_timer(0.2, self._ask, clock=STEADY)
        node.get_logger().info(f"recording into {self._bag.path}")

    def _tap(self, name: str, kind: str) -> Tap:
        store = partial(self._write, name, kind)
        return Tap(self._node, message_type(kind), name, QOS.get(name, RECORD), store)

    def _write(self, name: str, kind: str, received: int, raw: bytes) -> None:
        now = time.monotonic()
        if name == "torque_command":
            self._commanded = now
        if not name.startswith("/"):
            self._begin = self._begin or now
        topic = self._taps[name].topic
        if self._taps[name].count == 1:
            self._bag.offer(topic, kind, offered(self._node, topic))
        self._bag.write(topic, kind, received, raw)

    def _ask(self) -> None:
        """Ask the nodes of the namespace that are new for their parameters."""
        for name, space in self._node.get_node_names_and_namespaces():
            full = f"{space.rstrip('/')}/{name}"
            if full in self._asked or not f"{space}/".startswith(f"{self._node.get_namespace()}/"):
                continue
            if full not in self._clients:
                self._clients[full] = [
                    self._node.create_client(kind, f"{full}/{service}") for kind, service in SERVICES
                ]
            if all(client.service_is_ready() for client in self._clients[full]) and self._node.executor:
                self._asked.add(full)
                self._node.executor.create_task(self._keep_parameters, full, *self._clients.pop(full))

    async def _keep_parameters(self, full: str, ask: Any, get: Any) -> None:
        names = (await ask.call_async(ListParameters.Request())).result.names
        asked, name = time.time_ns(), "/parameter_events"  # before any change that the answer may lack
        values = (await get.call_async(GetParameters.Request(names=names))).values
        message = parameters_message(asked, full, dict(zip(names, values, strict=True)))
        self._bag.write(name, TOPICS[name], asked, serialize_message(message))
        for client in (ask, get):
            self._node.destroy_client(client)

    def is_finished(self) -> bool:
        """Return whether the duration is over, or the commands have ceased."""
        self._bag.keep_up()
        now = time.monotonic()
        ceased = self._commanded > 0.0 and now - self._commanded > self._quiet > 0.0
        return ceased or (self._begin > 0.0 and now - self._begin > self._duration > 0.0)

    def conclude(self) -> None:
        """Report the recorded messages."""
        self._tell()

    def close(self) -> None:
        self._bag.__exit__(*sys.exc_info())

    def _tell(self) -> None:
        words, _, lost = heard(self._taps)
        self._node.get_logger().info(f"{words or 'nothing yet'}; {lost} lost")

    def _report(self) -> NodeHealth:
        _, counts, lost = heard(self._taps)
        summary = f"{lost} messages lost" if lost else "recording"
        return NodeHealth(WARN if lost else OK, summary, {**counts, "lost_messages": lost})


NODE = Component("record", TABLE, RecordNode)
main = NODE.run

if __name__ == "__main__":
    sys.exit(main())
