"""A look: a second of a joint's events in order, with the events before it that let the filters settle."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.records.record import FloatArray, IntArray, Record

FILTER_SETTLING, LENGTH = 0.25, 1.0
"""s. Ten time constants of the disturbance's filter; long beside them, short beside a movement."""
FEWEST = 20
"""Measurements of a look that can be counts."""


class Look(NamedTuple):
    """Events by stamp: t (s, shape (n,)), kind (of observer/log.py), values (n, 2): position and motor
    torque, or ft, or command. counts: where the innovations count, shape (n,).
    """

    t: FloatArray
    kind: IntArray
    values: FloatArray
    counts: np.ndarray[tuple[int], np.dtype[np.bool_]]

    @property
    def end(self) -> float:
        """Last stamp, s."""
        return float(self.t[-1])

    def travel(self) -> float:
        """Return how far the joint moved, rad."""
        q = self.values[self.kind == STATE, 0]
        q = q[np.isfinite(q)]
        return float(np.ptp(q)) if len(q) else 0.0


class Cutter:
    """Cuts looks out of the stream. every: s from the beginning of one look to that of the next."""

    def __init__(self, every: float) -> None:
        self.every = every
        self.clear()

    def clear(self) -> None:
        """Forget all events."""
        self._t, self._kind = np.empty(0), np.empty(0, dtype=np.int64)
        self._values = np.empty((0, 2))
        self._begin = -np.inf

    def take(
        self, t: FloatArray, kind: IntArray, values: FloatArray, *, closer: bool = False
    ) -> Iterator[Look]:
        """Add events, sorted and later than those before; yield complete looks.

        closer: one look follows the other without a pause.
        """
        self._t = np.concatenate([self._t, t])
        self._kind = np.concatenate([self._kind, kind])
        self._values = np.concatenate([self._values, values])
        while len(self._t):
            if not np.isfinite(self._begin):
                self._begin = float(self._t[0])
            end = self._begin + FILTER_SETTLING + LENGTH
            if self._t[-1] <= end:
                break
            look = self._cut(self._begin, end)
            self._begin += LENGTH if closer else max(LENGTH, self.every)
            if look is not None:
                yield look
        self._drop()

    def _cut(self, begin: float, end: float) -> Look | None:
        first, last = np.searchsorted(self._t, [begin, end], side="right")
        before = np.flatnonzero(self._kind[:first] == COMMAND)[-1:]
        part = np.concatenate([before, np.arange(first, last)])
        t, kind = self._t[part], self._kind[part]
        counts = (t > begin + FILTER_SETTLING) & (kind != COMMAND)
        return Look(t, kind, self._values[part], counts) if counts.sum() >= FEWEST else None

    def _drop(self) -> None:
        """Drop events before the beginning of the next look, except the command in force."""
        first = int(np.searchsorted(self._t, min(self._begin, self._t[-1] if len(self._t) else 0.0)))
        before = np.flatnonzero(self._kind[:first] == COMMAND)[-1:]
        keep = int(before[0]) if len(before) else first
        self._t, self._kind, self._values = self._t[keep:], self._kind[keep:], self._values[keep:]


def events_of(record: Record) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return the events of a record, sorted: t, kind and values as a Look has them."""
    t, kind, values = [], [], []
    for name, number in (("position", STATE), ("ft", FT), ("command", COMMAND)):
        if name not in record:
            continue
        channel = record[name]
        both = np.full((len(channel), 2), np.nan)
        both[:, 0] = channel.y
        if name == "position" and "motor_torque" in record and len(record["motor_torque"]) == len(channel):
            both[:, 1] = record["motor_torque"].y
        t.append(channel.t)
        kind.append(np.full(len(channel), number))
        values.append(both)
    whole, kinds = np.concatenate(t), np.concatenate(kind)
    order = np.lexsort((kinds, whole))
    return whole[order], kinds[order], np.concatenate(values)[order]
