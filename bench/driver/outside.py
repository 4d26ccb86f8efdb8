"""A client of the controller: it sends desired torques and hears the bench."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy

from msg_adapters.ros import DiagnosticArray, JointState, torque_command_message
from msg_adapters.topic_map import AXES, JOINT_STATE, WRENCH
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._mailbox import Mailbox, MessageFields, Polled
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

HZ, SECONDS, SETTLE, LEAD = 5.0, 6.0, 1.0, 0.2
"""Of a sine, and s: its length, before it counts, ahead of its stamps."""


class Outside:
    """Sends desired torques and hears the bench: wrenches and commands as (stamp, torque, heard)."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("bench", namespace="rsea")
        self.wrenches: list[tuple[int, float, int]] = []
        self.commands: list[tuple[int, float, int]] = []
        self.health: dict[str, dict[str, str]] = {}
        self.desired = self.node.create_publisher(JointState, "desired_torque", COMMAND)
        self._ft, self._torques = (
            Mailbox(self.node, topic, MessageFields(kind, (field,)), qos, lambda: None)
            for kind, topic, qos, field in (
                (WRENCH, "ft", MEASUREMENT, ("wrench", AXES.index("torque.z"))),
                (JOINT_STATE, "torque_command", COMMAND, ("effort", 0)),
            )
        )
        self._diagnostics: Any = self.node.create_subscription(
            DiagnosticArray, "/diagnostics", lambda message: None, COMMAND, callback_group=Polled()
        )

    def until(self, condition: Callable[[], Any], timeout: float = 60.0) -> None:
        """Listen until a condition holds. Polling every ms loads the machine less than an executor."""
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the nodes did not answer")
            time.sleep(1e-3)
            self._hear()

    def _hear(self) -> None:
        for mailbox, heard in ((self._ft, self.wrenches), (self._torques, self.commands)):
            heard += [(stamp, number, received) for stamp, (number,), received in mailbox.take()]
        handle = self._diagnostics.handle
        with handle:
            while (message := handle.take_message(DiagnosticArray, False)) is not None:
                status = message[0].status[0]
                name = status.name.rpartition("/")[2]
                self.health[name] = {pair.key: pair.value for pair in status.values}


def sine(outside: Outside, amplitude: float, rate: float) -> list[float]:
    """Send a sine ahead of time on the grid of the measurements; return its relative error by period."""
    start = outside.wrenches[-1][0] + round(0.3 * rate) / rate * SECOND
    for k in range(round(SECONDS * rate)):
        stamp, t = round(start + k * SECOND / rate), k / rate
        outside.until(lambda stamp=stamp: stamp < time.time_ns() + LEAD * SECOND)  # type: ignore[misc]
        wanted = amplitude * np.sin(2 * np.pi * HZ * t) * min(1.0, 4.0 * t)
        outside.desired.publish(torque_command_message(stamp, wanted))
    outside.until(lambda: outside.wrenches[-1][0] > start + (SECONDS - 0.1) * SECOND)
    read = np.array(outside.wrenches)
    t = (read[:, 0] - start) / SECOND
    inside = (t > SETTLE) & (t < SECONDS - 0.2)
    error = (read[:, 1] - amplitude * np.sin(2 * np.pi * HZ * t))[inside]
    period = np.floor(t[inside] * HZ)
    rms = amplitude / np.sqrt(2.0)
    return [float(np.sqrt(np.mean(error[period == p] ** 2))) / rms for p in np.unique(period)]
