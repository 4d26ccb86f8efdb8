"""A thread that works at absolute deadlines. Timers of rclpy lose ticks at 1 kHz and drift; this does not."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

from rsea_ros.nodes._anchor import SECOND, Anchor
from rsea_ros.nodes._realtime import Worker

__all__ = ["SECOND", "Cycle", "Timing", "on_grid", "wait_until"]

LONGEST_CATCH_UP = SECOND


@dataclass(frozen=True)
class Timing:
    """Timing of a cycle since the last report: periods in s, and all cycles missed since its start."""

    mean: float
    p99: float
    longest: float
    missed: int

    def values(self) -> dict[str, object]:
        """Return it as diagnostics show it."""
        return {
            "period_mean_ms": f"{self.mean * 1e3:.4f}",
            "period_p99_ms": f"{self.p99 * 1e3:.4f}",
            "period_max_ms": f"{self.longest * 1e3:.4f}",
            "missed_cycles": self.missed,
        }


class Cycle(Worker):
    """Call `work(stamp)` at start + k / rate, stamp being that instant in ns since the epoch.

    A cycle is missed when the next one was due before it began. catch_up: missed cycles run late,
    each with its own stamp (no more than a second of them); otherwise they are left out.
    `left_out` counts those that never run.
    anchor: makes stamps from deadlines. Without one that the work lets follow, the system clock is
    read once, at the start: stamps stay even whatever happens to it later.
    """

    def __init__(
        self, rate: float, work: Callable[[int], None], *, catch_up: bool, anchor: Anchor | None = None
    ) -> None:
        super().__init__()
        self._rate, self._work, self._catch_up = rate, work, catch_up
        self._given, self.anchor = anchor, anchor or Anchor()
        self._over = threading.Event()
        self._began: list[int] = []
        self._missed = self.left_out = 0

    def start(self, first: int | None = None) -> None:
        """Begin with the cycle of stamp `first`, by default one period from now."""
        self.anchor = self._given or Anchor()
        begin = time.monotonic_ns()
        self._first = begin + self._instant(1) if first is None else first - self.anchor.offset
        self.thread.start()

    def rest(self) -> None:
        """Return when the work of a cycle is over, so that another thread's work delays no cycle."""
        self._over.clear()
        self._over.wait(2.0 / self._rate)

    def timing(self) -> Timing:
        """Return the statistics since the last call."""
        began, self._began = self._began, self._began[-1:]
        periods = sorted(b - a for a, b in pairwise(began)) or [0]
        p99 = periods[round(0.99 * (len(periods) - 1))]
        return Timing(fmean(periods) / SECOND, p99 / SECOND, periods[-1] / SECOND, self._missed)

    def _instant(self, k: int) -> int:
        return round(k * SECOND / self._rate)

    def run(self) -> None:
        """Work at the deadlines."""
        k = 0
        while not self.stopping.is_set():
            due = self._first + self._instant(k)
            wait_until(due)
            now = time.monotonic_ns()
            self._began.append(now)
            late = int((now - due) * self._rate / SECOND)
            self._missed += late > 0
            self._work(due + self.anchor.offset)
            self._over.set()
            allowed = int(LONGEST_CATCH_UP * self._rate / SECOND) if self._catch_up else 0
            skipped = late if late > allowed else 0
            self.left_out += skipped
            k += 1 + skipped


def on_grid(earliest: int, measured: int, rate: float) -> int:
    """Return the first instant not before another that is whole periods after a measurement, ns. rate: Hz."""
    return measured + round(math.ceil((earliest - measured) * rate / SECOND) * SECOND / rate)


def wait_until(due: int) -> None:
    """Sleep until an instant of the monotonic clock, ns; not at all when it is over."""
    wait = due - time.monotonic_ns()
    if wait > 0:
        time.sleep(wait / SECOND)
