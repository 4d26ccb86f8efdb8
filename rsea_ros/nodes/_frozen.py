"""Sensors that have stopped: a value that never changes, where its noise would change it."""

from __future__ import annotations

import math
from collections.abc import Sequence

SAMPLES, TIME = 10, 50_000_000
"""Equal samples, and ns of them, that are no chance."""


class Frozen:
    """One topic's values. A sensor at rest may show the same counts; then something else must have moved.

    least: motion of the other sensor that proves a freeze; 0: none needed, this sensor's noise suffices.
    """

    def __init__(self, least: float = 0.0) -> None:
        self._least = least
        self._last: Sequence[float] = ()
        self._since = self._count = 0
        self._low, self._high = math.inf, -math.inf
        self.frozen = False

    def take(self, stamp: int, values: Sequence[float]) -> bool:
        """Process a sample (stamp in ns); return whether the sensor has stopped."""
        if values != self._last or stamp < self._since:
            self._last, self._since, self._count, self.frozen = values, stamp, 0, False
            self._low, self._high = math.inf, -math.inf
        self._count += 1
        if self._count >= SAMPLES and stamp - self._since >= TIME:
            self.frozen = self.frozen or self._high - self._low >= self._least or self._least == 0.0
        return self.frozen

    def beside(self, value: float) -> None:
        """Process a sample of another sensor."""
        self._low, self._high = min(self._low, value), max(self._high, value)
