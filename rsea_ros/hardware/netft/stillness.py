"""A sensor whose values have stopped although its counters go on: its noise no longer changes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from rsea_ros.hardware.netft.receiver import Arrival

LEAST, TIMES = 50_000_000, 10
"""ns of equal records that are no chance; multiple of the longest such time at rest that they exceed."""


class Stillness:
    """The last change of any of the six values.

    limit: ns without one that are a fault; inf before `calibrate`, and for a sensor without noise. stopped:
    whether it was exceeded.
    """

    def __init__(self) -> None:
        self.limit, self.stopped = math.inf, False
        self._counts: Sequence[int] = ()
        self._changed = 0

    def calibrate(self, arrivals: Sequence[Arrival]) -> None:
        """Learn from records at rest for how long the values repeat."""
        changes = _changes(arrivals)
        times = [after - before for before, after in pairwise(changes)]
        self.limit = max(LEAST, TIMES * max(times)) if times else math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the last values."""
        self.stopped, self._counts, self._changed = False, (), 0

    def take(self, arrivals: Sequence[Arrival]) -> str:
        """Process records; return the fault in words, '' for none."""
        for arrival in arrivals:
            if arrival.record.counts != self._counts:
                self._counts, self._changed = arrival.record.counts, arrival.instant
        unchanged = arrivals[-1].instant - self._changed if arrivals else 0
        self.stopped = self.stopped or unchanged > self.limit
        return _words(unchanged) if unchanged > self.limit else ""

    def reason(self, arrivals: Sequence[Arrival]) -> str:
        """Return the fault in records of a while without any change, '' for none."""
        lasted = arrivals[-1].instant - arrivals[0].instant
        return "" if len(_changes(arrivals)) > 1 or lasted <= self.limit / TIMES else _words(lasted)


def _changes(arrivals: Sequence[Arrival]) -> list[int]:
    """Return the instants of the first record and of each that differs from the one before it, ns."""
    first = [arrival.instant for arrival in arrivals[:1]]
    return first + [b.instant for a, b in pairwise(arrivals) if a.record.counts != b.record.counts]


def _words(unchanged: int) -> str:
    return f"all six values unchanged for {unchanged / 1e6:.0f} ms: the sensor has stopped"
