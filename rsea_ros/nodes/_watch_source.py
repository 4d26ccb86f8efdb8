"""The data of the live view: the newest samples of each topic, taken on request of the page, and the health.

All subscriptions to measurements are best effort and hold a bounded queue: a publisher neither waits for this
node nor repeats anything for it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import Bool, DiagnosticArray
from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.nodes._anchor import SECOND
from rsea_ros.nodes._mailbox import Mailbox, MessageFields
from rsea_ros.nodes._qos import LATCHED, MEASUREMENT

SILENT, GONE = 3.0, 30.0
"""s after which a node's health is old, and after which it is forgotten."""
MOST_NODES = 40
STALE = 3
"""Level of a health that is old, as diagnostics number it."""
Rows = dict[str, list[tuple[float, float]]]


class WatchSource:
    """Samples by channel, flag and health. axis, joint: as for every node.

    newest: last stamp of joint_states, ns.
    """

    def __init__(self, node: Node, rig: Rig, axis: str, joint: str) -> None:
        self._namespace = node.get_namespace().rstrip("/") + "/"
        self._sign, along = sign_and_index(axis)
        self._stiffness = math.nan if rig.rigid_spring else rig["spring.stiffness"]
        self._angle_is_deflection = rig.clamped == set(END_NAMES)
        self.flag: bool | None = None
        self.newest, self._epoch = 0, 0
        self._refused = 0
        self._health: dict[str, tuple[float, Mapping[str, Any]]] = {}
        self._counted = time.monotonic()
        self.bench = f"{self._namespace.strip('/')} · {rig.name}"
        effort = ("effort", 0)
        self._boxes = {
            topic: Mailbox(
                node, topic, MessageFields(kind, tuple(fields), name, most), MEASUREMENT, self._refuse
            )
            for topic, kind, name, most, *fields in (
                ("joint_states", JOINT_STATE, joint, 1, ("position", 0), effort),
                ("ft", WRENCH, "", 1, ("wrench", along)),
                ("torque_estimate", JOINT_STATE, "", 3, effort, ("effort", 1), ("effort", 2)),
                ("torque_command", JOINT_STATE, joint, 1, effort),
            )
        }
        self._counts = dict.fromkeys(self._boxes, 0)
        node.create_subscription(Bool, "pure_torque", self._on_flag, LATCHED)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, MEASUREMENT)

    def take(self) -> Mapping[str, Sequence[tuple[float, float]]]:
        """Return the samples since the last call: s since the first stamp, SI."""
        rows: Rows = {}
        for stamp, (angle, effort) in self._of("joint_states"):
            self.newest = max(self.newest, stamp)
            _put(rows, self._seconds(stamp), motor=effort)
            if self._angle_is_deflection:
                _put(rows, self._seconds(stamp), deflection=angle)
        for stamp, (torque,) in self._of("ft"):
            t, torque = self._seconds(stamp), self._sign * torque
            _put(rows, t, ft=torque)
            if not self._angle_is_deflection and not math.isnan(self._stiffness):
                _put(rows, t, deflection=torque / self._stiffness)
        for stamp, (distal, proximal, disturbance) in self._of("torque_estimate"):
            _put(rows, self._seconds(stamp), distal=distal, proximal=proximal, disturbance=disturbance)
        for stamp, (torque,) in self._of("torque_command"):
            _put(rows, self._seconds(stamp or self.newest), command=torque)
        return rows

    def state(self) -> Mapping[str, Any]:
        """Return bench, health and rates, Hz, since the last call."""
        now = time.monotonic()
        span, self._counted = max(now - self._counted, 1e-3), now
        rates = {topic: round(count / span) for topic, count in self._counts.items() if count}
        self._counts = dict.fromkeys(self._boxes, 0)
        self._health = {name: each for name, each in self._health.items() if now - each[0] < GONE}
        shown = [_status_json(now - heard, each) for _, (heard, each) in sorted(self._health.items())]
        return {"bench": self.bench, "health": shown, "rates": rates}

    def _of(self, topic: str) -> Sequence[tuple[int, Sequence[float]]]:
        taken = [(stamp, numbers) for stamp, numbers, _ in self._boxes[topic].take(MEASUREMENT.depth)]
        self._counts[topic] += len(taken)
        return taken

    def _seconds(self, stamp: int) -> float:
        self._epoch = self._epoch or stamp
        return (stamp - self._epoch) / SECOND

    def _refuse(self) -> None:
        self._refused += 1

    def _on_flag(self, message: Bool) -> None:
        self.flag = bool(message.data)

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith(self._namespace) and len(self._health) < MOST_NODES:
                self._health[status.name] = (time.monotonic(), {
                    "name": status.name, "level": status.level[0], "message": status.message,
                    "values": [(each.key, each.value) for each in status.values],
                })  # fmt: skip


def _put(rows: Rows, t: float, **values: float) -> None:
    for name, value in values.items():
        rows.setdefault(name, []).append((t, value))


def _status_json(age: float, status: Mapping[str, Any]) -> Mapping[str, Any]:
    if age < SILENT:
        return status
    return {**status, "level": STALE, "message": f"silent for {age:.0f} s; before: {status['message']}"}
