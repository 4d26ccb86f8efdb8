"""The grid of sample times, and lateness on it.

Feedback is designed for a delay of one sample and tolerates one more and 2 ms (uncertainty.py). Beyond that
it is reduced with the lateness at once, and returns slowly: feedback that each command in turn switches
on and off makes the bench oscillate between the torque limits. Without feedback the command is feed-forward
alone, which no lateness makes unstable.
"""

import math
from collections import deque
from dataclasses import dataclass

SECOND = 1_000_000_000

EARLY = 0.3
"""Periods by which a measurement may come before its place. A cycle is late or in time, hardly early, so the
rest of the period is for lateness: one late cycle and one in time are two periods, never three."""
PULL_EARLY, PULL_LATE = 0.05, 0.02
"""Part of its error by which the grid follows a measurement that is early, and one that is late."""
JUMP = SECOND
"""ns; stamps that jump so far, either way, are of another run or of a clock that was set."""


class Grid:
    """Places on a grid. period: ns. offset: periods by which the last stamp lay behind its place."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._origin = 0  # ns; a float of ns since the epoch has steps of 256 ns
        self._at: float | None = None
        self.offset = 0.0

    def forget(self) -> None:
        """Let the next measurement be the first."""
        self._at = None

    def jumps(self, stamp: int) -> bool:
        """Return whether a stamp (ns) is of another run than those before."""
        return self._at is not None and abs(stamp - self._origin - self._at) > JUMP

    def place(self, stamp: int) -> int:
        """Return how many periods a stamp (ns) lies behind the one before; 0 for one in the same period.

        The first is one period behind nothing.
        """
        if self._at is None:
            self._origin, self._at, self.offset = stamp, 0.0, 0.0
            return 1
        behind = (stamp - self._origin - self._at) / self._period
        periods = math.floor(behind + EARLY)
        if periods <= 0:
            return 0
        error = behind - periods
        pull = PULL_EARLY if error < 0.0 else PULL_LATE
        self._at += (periods + pull * error) * self._period
        self.offset = (1.0 - pull) * error
        return periods

    @property
    def next(self) -> int:
        """The place of the next stamp, ns."""
        return self._origin + round((self._at or 0.0) + self._period)

    @property
    def at(self) -> int:
        """The place of the last stamp, ns."""
        return self._origin + round(self._at or 0.0)


BEYOND = 1.3
"""Samples beyond what the design stands after which no feedback counts."""
MOST = 10
"""Samples of one pause that count: several pauses are lateness that persists, one is not."""
RETURN = 0.3
"""s in which feedback comes back from none to all."""


SAMPLES, DELAY = 1, 2e-3
"""Samples, and s, by which a command may be late with all of the feedback."""


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
        self._full, self._gain = SAMPLES + DELAY * rate, 1.0 / (RETURN * rate)
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
