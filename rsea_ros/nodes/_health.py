"""The health of a node on /diagnostics, once a second."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from rclpy.node import Node

from msg_adapters.ros import ERROR, OK, WARN, DiagnosticArray, diagnostics_message
from rsea_ros.nodes._qos import COMMAND

__all__ = ["ERROR", "OK", "WARN", "Health", "Report"]


class Report(NamedTuple):
    """Level (OK, WARN, ERROR), one line, and values by name."""

    level: bytes
    summary: str
    values: Mapping[str, object]


class Health:
    """Publish what `assess` returns."""

    def __init__(self, node: Node, assess: Callable[[], Report]) -> None:
        self._name, self._assess = node.get_fully_qualified_name(), assess
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", COMMAND)
        node.create_timer(1.0, self.publish)

    def publish(self) -> None:
        """Publish now."""
        report = self._assess()
        self._publisher.publish(diagnostics_message(time.time_ns(), self._name, *report))
