"""A thread that works at absolute deadlines, and the stamps of its clock.

Timers of rclpy lose ticks at 1 kHz and drift; this does not.

All ages and deadlines of a node use the monotonic clock. Its messages, in and out, carry the system
clock's time, which a network or a person may set: the difference is followed while the system
clock is trimmed, and measured again when it has been set.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

from rsea_ros.nodes._realtime import Worker

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
