"""Quality of service. Deep queues: a depth of 10 drops messages at 1 kHz even when it is reliable."""

from __future__ import annotations

from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
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


def publishers_of(node: Node, topic: str) -> set[str]:
    """Return the full names of the nodes that publish a topic, named as the node resolves it."""
    infos = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
