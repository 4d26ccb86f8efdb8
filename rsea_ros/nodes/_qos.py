"""Quality of service. Deep queues: a depth of 10 drops messages at 1 kHz even when it is reliable."""

from __future__ import annotations

from typing import Any, ClassVar
from weakref import WeakKeyDictionary

from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.qos_overriding_options import QoSOverridingOptions

from rsea_ros.nodes._cycle import SECOND

COMMAND = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)
MEASURED = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)
MEASUREMENT = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of who publishes measurements, heard by any subscription (REP 2003); of who listens for the newest."""
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
RECORD = QoSProfile(depth=5000, reliability=ReliabilityPolicy.BEST_EFFORT)
RECORD_RELIABLE = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE)
"""RECORD matches every publisher; RECORD_RELIABLE only reliable ones, and then nothing is lost."""

OVERRIDES = QoSOverridingOptions.with_default_policies()
"""Depth, history and reliability by parameter: qos_overrides./rsea/ft.publisher.reliability and so on."""

DISCOVERY_TIME = SECOND // 2
"""ns. A publisher knows of a subscriber before that knows of it."""
ARRIVAL = Duration(seconds=1)
"""Usual are 5 to 11 ms; a subscriber that hangs is waited for so long."""


def await_arrival(publisher: Publisher[Any]) -> None:
    """Wait until every reliable subscriber has received the messages.

    On a busy machine one of four subscribers loses the last message of a node that exits at once.
    """
    publisher.wait_for_all_acked(ARRIVAL)


RECORD_LATCHED = QoSProfile(
    depth=200, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Of what was published last before the recording began."""


def offered(node: Node, topic: str) -> list[dict[str, Any]]:
    """Return the QoS of each publisher of a topic as rosbag2 writes it (metadata version 9)."""
    found = []
    for info in node.get_publishers_info_by_topic(topic):
        qos = info.qos_profile
        spans = ((name, getattr(qos, name).nanoseconds) for name in ("deadline", "lifespan"))
        times = {name: {"sec": ns // SECOND, "nsec": ns % SECOND} for name, ns in spans}
        lease = qos.liveliness_lease_duration.nanoseconds
        found.append({
            "history": qos.history.short_key, "depth": qos.depth, "reliability": qos.reliability.short_key,
            "durability": qos.durability.short_key, **times, "liveliness": qos.liveliness.short_key,
            "liveliness_lease_duration": {"sec": lease // SECOND, "nsec": lease % SECOND},
            "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
        })  # fmt: skip
    return found


class Incompatible(SubscriptionEventCallbacks):
    """Has a node tell of partners whose QoS does not fit one of its subscriptions, polled or not.

    rclpy's own callback is served with the messages: by nobody where these are polled.
    """

    _asked: ClassVar[WeakKeyDictionary[Node, dict[str, QoSProfile]]] = WeakKeyDictionary()

    def __init__(self, node: Node, topic: str, qos: QoSProfile, **others: Any) -> None:
        """others: callbacks of other events."""

        def tell(event: Any) -> None:
            self._asked.setdefault(node, {})[topic] = qos
            for line in self.words(node):
                node.get_logger().warning(line)

        super().__init__(incompatible_qos=tell, **others)
        self._group = node.default_callback_group

    def create_event_handlers(self, callback_group: Any, subscription: Any, topic_name: str) -> Any:
        """Serve the events with the node's other work."""
        return super().create_event_handlers(self._group, subscription, topic_name)

    @classmethod
    def words(cls, node: Node) -> list[str]:
        """Return the publishers that are there and cannot be heard, in words."""
        return [
            f"{topic}: nothing is heard of {info.node_name}, whose QoS does not fit: {reason.strip(' ;')}"
            for topic, qos in cls._asked.get(node, {}).items()
            for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
            for level, reason in [qos_check_compatible(info.qos_profile, qos)]
            if level == QoSCompatibility.ERROR
        ]


def publishers_of(node: Node, topic: str) -> set[str]:
    """Return the full names of the nodes that publish a topic, named as the node resolves it."""
    infos = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
