"""What the health node hears, and the noise that it and the model node expect."""

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from msg_adapters.topic_map import JOINT_STATE, WRENCH, sign_and_index
from rsea_ros.errors import ParameterError
from rsea_ros.model.extent import LARGEST
from rsea_ros.model.observer import Noise, noise_of
from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.model.rig import Rig
from rsea_ros.nodes._commands import HORIZON
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._mailbox import Mailbox, MessageFields
from rsea_ros.nodes._qos import RECORD
from rsea_ros.records.record import FloatArray, IntArray

LAG = SECOND // 10
"""ns that one topic may come later than another and still be put in its place."""
MOST = 10_000
"""Events that wait at most: commands without measurements would wait, and grow, for as long as these stop."""
Events = tuple[FloatArray, IntArray, FloatArray]
Keep = Callable[[str, str, int, bytes], None]


class HealthInputs:
    """Best-effort subscriptions; nothing waits for them. keep: gets topic, type, arrival (ns), bytes."""

    def __init__(self, node: Node, axis: str, joint: str, keep: Keep) -> None:
        self._sign, along = sign_and_index(axis)
        self.epoch: int | None = None
        self._newest = 0
        self._waiting: list[tuple[int, int, float, float]] = []
        self.refused = self.unstamped = 0
        self.counts = {"torque_command": 0, "joint_states": 0, "ft": 0}

        def mailbox(topic: str, kind: str, *fields: tuple[str, int]) -> Mailbox:
            read = MessageFields(kind, fields, "" if topic == "ft" else joint)
            box = Mailbox(
                node, topic, read, RECORD, self._refuse,
                keep=lambda at, raw: keep(box.subscription.topic_name, kind, at, raw),
            )  # fmt: skip
            return box

        self._commands = mailbox("torque_command", JOINT_STATE, ("effort", 0))
        self._states = mailbox("joint_states", JOINT_STATE, ("position", 0), ("effort", 0))
        self._fts = mailbox("ft", WRENCH, ("wrench", along))

    def take(self) -> Events:
        """Return the complete events: t (s since the first stamp), kind and values of a Look."""
        states = [(t, STATE, q, u) for t, (q, u), _ in self._states.take()]
        fts = [(t, FT, self._sign * y, math.nan) for t, (y,), _ in self._fts.take()]
        commands = [(t, COMMAND, u, math.nan) for t, (u,), _ in self._commands.take()]
        for name, came in (("torque_command", commands), ("joint_states", states), ("ft", fts)):
            self.counts[name] += len(came)
        measured = states + fts
        if measured:
            newest = max(row[0] for row in measured)
            if abs(newest - self._newest) > SECOND:
                self._waiting.clear()
            self._newest = newest
        self._waiting += measured + [row for row in map(self._place, commands) if row is not None]
        self._waiting.sort()
        del self._waiting[:-MOST]
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

    def _place(self, row: tuple[int, int, float, float]) -> tuple[int, int, float, float] | None:
        """Return a command at the instant from which it counts; None for one that is not a number."""
        stamp, kind, torque, _ = row
        if not math.isfinite(torque):
            self._refuse()
            return None
        if stamp == 0 or (self._newest and abs(stamp - self._newest) > HORIZON):
            self.unstamped += 1
            stamp = self._newest
        return stamp, kind, torque, math.nan

    def _refuse(self) -> None:
        self.refused += 1


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
