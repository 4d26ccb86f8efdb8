"""A node that visits a graph: it looks, listens and leaves."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from msg_adapters.ros import message_text, message_type
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._run import LOCAL, NAMESPACE

DISCOVERY = 3.0
"""s within which whatever runs has been discovered."""
POLL = 0.05
"""s between two looks."""


@contextmanager
def visit(name: str) -> Iterator[Node]:
    """Yield a node that logs nowhere and offers no services; leave the graph afterwards."""
    os.environ.setdefault(*LOCAL)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def spin(node: Node, seconds: float, is_done: Callable[[], bool]) -> None:
    """Serve a node's callbacks until something is done, for some seconds at most."""
    deadline = time.monotonic() + seconds
    while not is_done() and (left := deadline - time.monotonic()) > 0.0:
        rclpy.spin_once(node, timeout_sec=min(left, POLL))


def absolute(name: str) -> str:
    """Return the full name of a topic, a node or a service; a relative one stands in our namespace."""
    return name if name.startswith("/") else f"/{NAMESPACE}/{name}"


_ROS_TOPICS = ("/rosout", "/parameter_events")


class Listener:
    """Subscribes to any topic; publishes nothing. node: the visitor through which it does."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def topics(self, seconds: float) -> list[tuple[str, str, str, str]]:
        """Return name, type, numbers of publishers and subscribers of topics discovered within some seconds.

        While there is none, keep looking: on a busy machine a discovery takes longer.
        """
        deadline = time.monotonic() + max(seconds, DISCOVERY)
        time.sleep(seconds)
        while not (topics := self._seen()) and time.monotonic() < deadline:
            time.sleep(POLL)
        return topics

    def _seen(self) -> list[tuple[str, str, str, str]]:
        return [
            (name, ", ".join(types), *self._counts(name))
            for name, types in self._node.get_topic_names_and_types()
            if name not in _ROS_TOPICS
        ]

    def rate(self, topic: str, seconds: float) -> str:
        """Return a line: messages a second over some seconds, and the longest time between two."""
        arrivals: list[float] = []
        name = self._subscribe(topic, lambda raw: arrivals.append(time.monotonic()), raw=True)
        spin(self._node, seconds, lambda: False)
        if len(arrivals) < 2:
            return f"{name}: {len(arrivals)} messages in {seconds:g} s"
        span = arrivals[-1] - arrivals[0]
        longest = max(b - a for a, b in pairwise(arrivals))
        return (
            f"{name}: {(len(arrivals) - 1) / span:.2f} Hz, longest gap {1e3 * longest:.1f} ms "
            f"({len(arrivals)} messages in {span:.2f} s)"
        )

    def messages(self, topic: str, count: int, seconds: float) -> Iterator[str]:
        """Yield the next messages of a topic as text. Raises ParameterError when none comes in time."""
        waiting: list[Any] = []
        name = self._subscribe(topic, waiting.append, raw=False)
        for number in range(count):
            spin(self._node, seconds, lambda: bool(waiting))
            if not waiting:
                raise ParameterError(f"{name}: {number} messages within {seconds:g} s, expected {count}")
            yield message_text(waiting.pop(0))

    def _subscribe(self, topic: str, hear: Any, *, raw: bool) -> str:
        """Subscribe to a topic with the durability of its publisher; return its full name."""
        name = absolute(topic)
        kind = self._type_of(name)
        publishers = self._node.get_publishers_info_by_topic(name)
        is_latched = any(p.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in publishers)
        qos = QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.RELIABLE if is_latched else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
        )
        self._node.create_subscription(message_type(kind), name, hear, qos, raw=raw)
        return name

    def _type_of(self, name: str) -> str:
        """Return the type of a topic. Raises ParameterError when nobody publishes it."""
        deadline = time.monotonic() + DISCOVERY
        known: dict[str, list[str]] = {}
        while time.monotonic() < deadline:
            known = dict(self._node.get_topic_names_and_types())
            if known.get(name) and self._node.count_publishers(name):
                return known[name][0]
            time.sleep(POLL)
        near = did_you_mean(name, known)
        raise ParameterError(f"topic {name}: nobody publishes it{near} (rsea topics lists what there is)")

    def _counts(self, name: str) -> tuple[str, str]:
        return str(self._node.count_publishers(name)), str(self._node.count_subscribers(name))
