"""The even grid that measurements lie on, followed by its phase: how many periods lie between two of them."""

from __future__ import annotations

import math

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
