"""Threads that keep time: exact timers, deadlines, priority where permitted; and the stamps of their clock.

Timers of rclpy lose ticks at 1 kHz and drift; this does not.

All ages and deadlines of a node use the monotonic clock. Its messages, in and out, carry the system
clock's time, which a network or a person may set: the difference is followed while the system
clock is trimmed, and measured again when it has been set.
"""

import ctypes
import gc
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

from rclpy.node import Node

from rsea_ros.errors import ParameterError
from rsea_ros.nodes._parameters import NodeParameter

SET_TIMER_SLACK = 29
"""Of Linux' prctl."""
SWITCH_INTERVAL = 5e-5
"""s after which a thread of Python must let another one in: each that waits looks for it as often (373)."""
PROCESSORS = os.sched_getaffinity(0)
"""That this process may run on."""
_timed: dict[int, int] = {}
"""Priority of each thread that keeps time, by its number; none where none has one."""
REALTIME = (
    NodeParameter(
        "realtime_priority", 0, "of the thread that keeps time, SCHED_FIFO; 0: as any process", "", 0,
        os.sched_get_priority_max(os.SCHED_FIFO), whole=True,
    ),
    NodeParameter(
        "cpu_affinity", -1, "processor that all threads of the node run on; -1: any", "", -1,
        max(PROCESSORS), whole=True,
    ),
)  # fmt: skip
"""Of every node that has to answer in time."""


class Worker:
    """A thread with exact timers that does `run` of its kind until `stop`. error: what ended it before."""

    def __init__(self) -> None:
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self._keep_error, daemon=True)
        self.error: Exception | None = None

    def start(self) -> None:
        """Begin."""
        self.thread.start()

    def stop(self) -> None:
        """End after the work that is done now."""
        self.stopping.set()
        if self.thread.is_alive() and threading.current_thread() is not self.thread:
            self.thread.join()

    def is_running(self) -> bool:
        """Return whether it still runs. Raises the error of its work."""
        if self.error is not None:
            raise self.error
        return self.thread.is_alive()

    def run(self) -> None:
        """Work until `stopping` is set."""
        raise NotImplementedError

    def _keep_error(self) -> None:
        exact_timers()
        try:
            self.run()
        except Exception as error:  # handed to the main thread by `is_running`
            self.error = error


def keep_time(node: Node, worker: Worker, values: Mapping[str, Any]) -> None:
    """Start a worker with a timed thread, as the parameters REALTIME of its node say."""
    sys.setswitchinterval(SWITCH_INTERVAL)  # Python's own, 5 ms, is longer than a cycle, and so is
    gc.collect()  # a garbage collection over everything that a node has loaded
    gc.freeze()
    ctypes.CDLL(None).malloc_trim(0)  # what imports and designs have left
    worker.start()
    processor = values["cpu_affinity"]
    if processor in PROCESSORS:
        _bind({processor})
    elif processor >= 0:
        allowed = ", ".join(map(str, sorted(PROCESSORS)))
        node.get_logger().warning(
            f"parameter cpu_affinity = {processor}, expected one of {allowed}; runs on any"
        )
    if priority := values["realtime_priority"]:
        try:
            raise_priority(worker.thread, priority)
        except ParameterError as error:
            node.get_logger().warning(f"{error}; runs without")


def raise_priority(first: threading.Thread, priority: int) -> None:
    """Let a thread run at SCHED_FIFO `priority`, and every other thread of this process one below it.

    They share the locks of the interpreter and of the middleware, through which messages arrive:
    one that holds a lock without the processor delays all, and those that wait for the interpreter's look for
    it every SWITCH_INTERVAL: two of them took 163 % of a core, and with it the processor of the one that they
    waited for. Children begin at normal priority, threads too until `raise_new_threads`.
    Raises ParameterError where the system does not permit it.
    """
    assert first.native_id is not None
    _timed[first.native_id] = priority
    try:
        raise_new_threads()
    except PermissionError as error:
        _timed.clear()
        raise ParameterError(
            f"parameter realtime_priority = {priority}: {error.strerror}, expected a user who may"
            " (rtprio in /etc/security/limits.d, docs/hardware.md)"
        ) from None


def raise_new_threads() -> None:
    """Give threads that have begun since then their priority, while one of this process keeps time at one."""
    for thread in _threads() if _timed else ():
        level = _timed.get(thread, max(1, max(_timed.values()) - 1))
        with suppress(ProcessLookupError):  # it has ended meanwhile
            if os.sched_getparam(thread).sched_priority != level:
                _schedule(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, level)


def exact_timers() -> None:
    """Let the timers of the calling thread end when they are due: Linux adds up to 50 us, also to the wait
    for Python's interpreter lock."""
    ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)


def stop_keeping_time(values: Mapping[str, Any]) -> None:
    """Undo what the parameters REALTIME have set, for all threads; what others have set stays."""
    if values["cpu_affinity"] >= 0:
        _bind(PROCESSORS)
    if values["realtime_priority"]:
        _timed.clear()
        for thread in _threads():
            _schedule(thread, os.SCHED_OTHER, 0)


def _bind(processors: Set[int]) -> None:
    """Let all threads of this process run on these processors only; those that they start do likewise."""
    for thread in _threads():
        with suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(thread, processors)


def _threads() -> list[int]:
    return [int(name) for name in os.listdir("/proc/self/task")]


def _schedule(thread: int, policy: int, priority: int) -> None:
    with suppress(ProcessLookupError):  # it has ended meanwhile
        os.sched_setscheduler(thread, policy, os.sched_param(priority))


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
