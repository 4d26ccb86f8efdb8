"""A node for a short visit to a running graph: it looks, listens or calls, and leaves."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

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
