"""What the health node hears, and the noise that it and the model node expect."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from rsea_ros.errors import ParameterError
from rsea_ros.model.extent import LARGEST
from rsea_ros.model.observer import Noise, noise_of
from rsea_ros.model.observer.log import COMMAND
from rsea_ros.model.rig import Rig
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._mailbox import Event, JointTopics, Keep
from rsea_ros.nodes._qos import RECORD
from rsea_ros.records.record import FloatArray, IntArray

LAG = SECOND // 10
"""ns that one topic may come later than another and still be put in its place."""
MOST = 10_000
"""Events that wait at most: commands without measurements would wait, and grow, for as long as these stop."""
Events = tuple[FloatArray, IntArray, FloatArray]
_TOPICS = ("joint_states", "ft", "torque_command")
"""By kind of the events on them."""


class HealthInputs(JointTopics):
    """Best-effort subscriptions; nothing waits for them. keep: as of JointTopics."""

    def __init__(self, node: Node, axis: str, joint: str, keep: Keep) -> None:
        super().__init__(node, axis, joint, RECORD, RECORD, keep)
        self.epoch: int | None = None
        self._newest = 0
        self._waiting: list[Event] = []
        self.counts = {"torque_command": 0, "joint_states": 0, "ft": 0}

    def take(self) -> Events:
        """Return the complete events: t (s since the first stamp), kind and values of a Look."""
        came = self.events()
        for _, kind, *_ in came:
            self.counts[_TOPICS[kind]] += 1
        measured = [event for event in came if event[1] != COMMAND]
        if measured:
            newest = max(event[0] for event in measured)
            if abs(newest - self._newest) > SECOND:
                self._waiting.clear()
            self._newest = newest
        for stamp, kind, torque, _ in came:
            if kind == COMMAND and not math.isfinite(torque):
                self.refuse()
            elif kind == COMMAND:
                measured.append((self.instant(stamp, self._newest), kind, torque, math.nan))
        self._waiting = sorted(self._waiting + measured)[-MOST:]
        return self._ready()

    def _ready(self) -> Events:
        """Return the events that are old enough, and keep the others."""
        limit = self._newest - LAG
        ready = [row for row in self._waiting if row[0] <= limit]
        self._waiting = self._waiting[len(ready) :]
        if ready and self.epoch is None:
            self.epoch = ready[0][0]
        stamps = np.array([row[0] - (self.epoch or 0) for row in ready], dtype=np.int64)
        values = np.array([row[2:] for row in ready], dtype=np.float64).reshape(-1, 2)
        return stamps / SECOND, np.array([row[1] for row in ready], dtype=np.int64), values

    def stamp(self, t: float) -> int:
        """Return the stamp of an instant, ns since 1970."""
        return (self.epoch or 0) + round(t * SECOND)


_EXPECTED = "expected an identification.json of rsea identify"


def noise_from(rig: Rig, path: str) -> Noise:
    """Return the noise of a rig, measured where an identification.json is named.

    Raises ParameterError for a file of another kind.
    """
    if not path:
        return noise_of(rig)
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        why = error.strerror if isinstance(error, OSError) else "no JSON"
        raise ParameterError(f"parameter identification = {path!r}: {why}, {_EXPECTED}") from None
    if not isinstance(document, dict):
        raise ParameterError(f"parameter identification = {path!r}, {_EXPECTED}")
    return noise_of(rig, _numbers(document, "noise_rms", path), _numbers(document, "residual_rms", path))


def _numbers(document: Mapping[str, Any], name: str, path: str) -> dict[str, float]:
    values = document.get(name)
    if not isinstance(values, dict):
        raise ParameterError(f"{path}: {name} = {values!r}, expected numbers by channel")
    numbers = {channel: v for channel, v in values.items() if isinstance(v, (int, float))}
    for channel, value in numbers.items():
        if not 0 <= value <= LARGEST:
            raise ParameterError(f"{path}: {name}.{channel} = {str(value)[:40]}, expected 0 to {LARGEST:g}")
    return {channel: float(value) for channel, value in numbers.items()}
