"""The health of a node on /diagnostics, once a second."""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from msg_adapters.ros import ERROR, OK, WARN, DiagnosticArray, diagnostics_message
from rsea_ros.nodes._cycle import raise_new_threads
from rsea_ros.nodes._qos import COMMAND, Incompatible

__all__ = ["ERROR", "OK", "STEADY", "WARN", "Health", "NodeHealth"]

STEADY = Clock(clock_type=ClockType.STEADY_TIME)
"""Of timers: rclpy's own stand still for as long as the system clock is set back."""


class NodeHealth(NamedTuple):
    """Level (OK, WARN, ERROR), one line, and values by name."""

    level: bytes
    summary: str
    values: Mapping[str, object]


class Health:
    """Publishes the status from `assess`. hardware: its subject. part: of a node that has several."""

    def __init__(
        self, node: Node, assess: Callable[[], NodeHealth], hardware: str = "", part: str = ""
    ) -> None:
        self._node, self._assess, self.hardware = node, assess, hardware
        self._part = f"/{part}" if part else ""
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", COMMAND)
        node.create_timer(1.0, self.publish, clock=STEADY)

    def publish(self) -> None:
        """Publish now, and see to new threads. An assessment that fails is an error, and ends no node."""
        raise_new_threads()
        name = f"{self._node.get_fully_qualified_name()}{self._part}"
        try:
            report = self._assess()
            if lines := Incompatible.words(self._node):
                told = report.summary if report.level != OK else ""
                words = "; ".join(filter(None, (told, *lines)))
                report = NodeHealth(max(report.level, WARN), words, report.values)
        except Exception as error:
            text = f"no assessment: {type(error).__name__}: {error}"
            self._node.get_logger().error(text, throttle_duration_sec=10.0)
            report = NodeHealth(ERROR, text, {})
        self._publisher.publish(diagnostics_message(time.time_ns(), name, *report, self.hardware))
