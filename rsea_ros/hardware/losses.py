"""Answers that do not come: one costs a cycle, several in a row are a fault, and so is half of many."""

from __future__ import annotations

import math
from collections import deque

from rsea_ros.hardware.interlock import DeviceFault

WINDOW, SHARE = 10, 0.5
"""Answers that are looked at, as a multiple of those that are a fault in a row, and the part of them."""


class Losses:
    """Lost answers of one kind of transaction. limit: cycles in a row that are a fault."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._recent: deque[bool] = deque(maxlen=WINDOW * limit)
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._recent.clear()
        self._in_a_row = self._count = 0

    def take_back(self) -> None:
        """Count the last answer, which was lost, as one that came after all."""
        if self._recent and self._recent[-1]:
            self._recent[-1] = False
            self._count -= 1
        self._in_a_row = 0

    def take(self, *, lost: bool) -> DeviceFault | None:
        """Take in whether the answer of a cycle was lost; return the fault that it is."""
        if len(self._recent) == self._recent.maxlen:
            self._count -= self._recent[0]
        self._recent.append(lost)
        self._count += lost
        self._in_a_row = self._in_a_row + 1 if lost else 0
        if self._in_a_row >= self._limit:
            return DeviceFault("no_reply", self._in_a_row, self._limit, "cycles")
        most = math.ceil(SHARE * WINDOW * self._limit)
        if lost and self._count >= most:
            return DeviceFault("no_reply", self._count, most, "cycles", f"of the last {len(self._recent)}: ")
        return None
