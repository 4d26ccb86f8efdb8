"""Late commands: the part of the feedback that still counts.

Feedback is designed for a delay of one sample and tolerates one more and 2 ms (uncertainty.py). Beyond that
it is reduced with the lateness at once, and returns slowly: feedback that each command in turn switches
on and off makes the bench oscillate between the torque limits. Without feedback the command is feed-forward
alone, which no lateness makes unstable.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from rsea_ros.control.uncertainty import Uncertainty

BEYOND = 1.3
"""Samples beyond what the design stands after which no feedback counts."""
MOST = 10
"""Samples of one pause that count: several pauses are lateness that persists, one is not."""
RETURN = 0.3
"""s in which feedback comes back from none to all."""


@dataclass(frozen=True)
class Tolerance:
    """Lateness is a fault when a share of the commands within a time (s) was later than `late` samples."""

    share: float = 0.5
    time: float = 1.0
    late: float = 1.0


class Lateness:
    """Follow how late commands are, in samples beyond that of the design. trust: part of feedback."""

    def __init__(self, rate: float, tolerance: Tolerance | None = None) -> None:
        """rate: Hz."""
        u = Uncertainty()
        self._full, self._gain = u.samples + u.delay * rate, 1.0 / (RETURN * rate)
        self.tolerance = tolerance or Tolerance()
        self._window = max(1, round(self.tolerance.time * rate))
        self.clear()

    def clear(self) -> None:
        """Restart with all feedback."""
        self.trust, self.count = 1.0, 0
        self._recent: deque[bool] = deque(maxlen=self._window)

    def take(self, late: float, count: int = 1) -> float:
        """Record how late a command will act (samples); return the trust.

        count: the samples that it covers, many after a pause; 0: another command replaces it.
        """
        for _ in range(min(count, MOST)):
            self._count(late > self.tolerance.late)
        if not count:
            return self.trust
        wanted = min(max(1.0 - (late - self._full) / BEYOND, 0.0), 1.0)
        self.trust = min(wanted, self.trust + self._gain)
        return self.trust

    def _count(self, late: bool) -> None:
        if len(self._recent) == self._window:
            self.count -= self._recent[0]
        self._recent.append(late)
        self.count += late

    @property
    def persists(self) -> bool:
        """Whether enough commands were late for a fault."""
        return self.count >= self.tolerance.share * self._window
