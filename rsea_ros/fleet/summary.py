"""What a run of the fleet did, and at which rate."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from rsea_ros.progress import Progress


@dataclass
class RunSummary:
    """The summary of a run.

    outcomes: rows written, by outcome. before: rows that the store had. unmapped: recordings that hold no
    joint, example: one of them. undated: rows without a time. changed: recordings that were being written,
    unreadable: those that could not be read, with the reason; the next run tries both again. quarantined:
    joint, recording and reason of each such row.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    before: int = 0
    unmapped: int = 0
    example: str = ""
    undated: int = 0
    changed: list[str] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    quarantined: list[tuple[str, str, str]] = field(default_factory=list)

    @property
    def rows(self) -> int:
        """How many rows were written."""
        return sum(self.outcomes.values())

    def sentence(self) -> str:
        """Return all counts as one line."""
        parts = [f"{n} {outcome}" for outcome, n in sorted(self.outcomes.items())] or ["nothing new"]
        others = {
            "in the store before": self.before,
            "changed while read": len(self.changed),
            "unreadable": len(self.unreadable),
            "of no joint": self.unmapped,
            "without a date": self.undated,
        }
        return ", ".join([*parts, *(f"{n} {name}" for name, n in others.items() if n)])


class Rate:
    """Counts the finished part of a known total, with rate and time left."""

    def __init__(self, total: int, tell: Progress, clock: Callable[[], float] = time.monotonic) -> None:
        self._total, self._tell, self._clock = total, tell, clock
        self._over = self._worked = 0
        self._begin = clock()

    def over(self, count: int, *, worked: bool = True) -> None:
        """Count tasks that are over. worked: they took time now; else they were done before."""
        self._over += count
        self._worked += count if worked else 0
        self._tell(self.text(), self._over / self._total)

    def text(self) -> str:
        """Return `12/40, 3.4 a minute, 8 min left`."""
        begun = f"{self._over}/{self._total}"
        minutes = (self._clock() - self._begin) / 60.0
        if not self._worked or minutes <= 0.0:
            return begun
        rate = self._worked / minutes
        return f"{begun}, {rate:.3g} a minute, {duration((self._total - self._over) / rate)} left"


def duration(minutes: float) -> str:
    """Return a length of time as people say it."""
    if minutes < 1.5:
        return f"{60.0 * minutes:.0f} s"
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
