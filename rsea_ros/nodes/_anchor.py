"""Stamps from a clock that nobody sets, and the difference of the system clock from it.

All ages and deadlines of a node use the monotonic clock. Its messages, in and out, carry the system
clock's time, which a network or a person may set: the difference is followed while the system
clock is trimmed, and measured again when it has been set.
"""

import time
from collections.abc import Callable

SECOND = 1_000_000_000
SLACK = SECOND // 2_000
"""ns that the clocks may differ before they are followed: readings scatter by less on a busy machine."""
STEP = SECOND // 50
"""ns from which on the system clock was set, not trimmed: 0.5 ms a second is what trimming does at most."""
TRIM = 1_000
"""Part (1 in so many) of the time that passes by which stamps follow a trimmed clock."""
TIGHT, TRIES = 20_000, 5
"""ns between two readings of the monotonic clock that are one instant; how often that is tried."""

Clock = Callable[[], int]


class Anchor:
    """The epoch's time, ns, of a monotonic clock.

    steps: how often the system clock was set. last_step: by how much the last time, s.
    """

    def __init__(self, wall: Clock | None = None, steady: Clock | None = None) -> None:
        """wall, steady: return ns; by default the clocks of the system."""
        self._wall, self._steady = wall or time.time_ns, steady or time.monotonic_ns
        self._first = self.offset = self._difference()
        self._followed = self._steady()
        self.steps, self.last_step = 0, 0.0

    def now(self) -> int:
        """Return the time, ns since the epoch; it never jumps but in `follow`."""
        return self._steady() + self.offset

    @property
    def shift(self) -> int:
        """How far the anchor has been moved since it was made, ns."""
        return self.offset - self._first

    def arrival(self, received: int, earliest: int) -> int:
        """Return when a message came that the system clock says was received at an instant, ns.

        earliest: when messages were taken the time before. The system clock may have been set since.
        """
        now = self.now()
        return now - min(max(self._wall() - received, 0), max(now - earliest, 0))

    def follow(self) -> int:
        """Follow a system clock that is trimmed; re-anchor and return the step (ns) when it was set."""
        now = self._steady()
        most, self._followed = (now - self._followed) // TRIM, now
        off = self._wall() - now - self.offset
        if abs(off) <= SLACK:
            return 0
        off = self._difference() - self.offset
        if abs(off) <= STEP:
            self.offset += min(max(off, -most), most) if abs(off) > SLACK else 0
            return 0
        self.offset += off
        self.steps, self.last_step = self.steps + 1, off / SECOND
        return off

    def values(self) -> dict[str, object]:
        """Return it as diagnostics show it."""
        return {"clock_steps": self.steps, "last_clock_step_s": f"{self.last_step:.3f}"}

    def _difference(self) -> int:
        """Return system clock less monotonic clock, ns, of the tightest of some readings."""
        readings = []
        for _ in range(TRIES):
            before, wall, after = self._steady(), self._wall(), self._steady()
            readings.append((after - before, wall - (before + after) // 2))
            if after - before < TIGHT:
                break
        return min(readings)[1]
