"""The engine: it finds new recordings, runs and repeats tasks, writes their rows, and sums up what it did.

One loop in one process: it alone writes to the store. A recording that the store does not know by path, bytes
and stamp is fingerprinted first; its content decides whether it is new.
"""

from __future__ import annotations

import heapq
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from rsea_extras.fleet.pool import Done, Executor, Job, WorkerLost
from rsea_extras.fleet.sources import Bag
from rsea_extras.fleet.store import Store, TaskOutcome
from rsea_extras.fleet.task import TIME_LIMIT, Changed, Held, Task, read_fingerprint, reason
from rsea_ros import RseaError
from rsea_ros.extension.base import Progress, version

ATTEMPTS = 5
"""Of a task whose worker is lost each time, before it counts as poison."""
BASE, FACTOR = 350e6, 12.0
"""Bytes that a worker takes beside a recording, and for each byte of it (measured on 26 November 2026)."""
_TURN = 1.0
"""s that the loop waits at most before it looks at its clock and at the scheduler."""


@dataclass(frozen=True)
class EngineLimits:
    """memory: bytes that a worker may have, None for no limit.

    back_off: s before the second attempt of a task whose worker was lost; twice as long before each further.
    time: s that a task may take. pages: whether each diagnosis leaves its page.
    """

    memory: int | None = None
    back_off: float = 0.5
    time: float = TIME_LIMIT
    pages: bool = False


class Engine:
    """One run over some recordings. work: the function of a task, called in a process of the executor."""

    def __init__(
        self,
        store: Store,
        executor: Executor,
        work: Callable[[Task], TaskOutcome],
        tell: Progress,
        limits: EngineLimits | None = None,
    ) -> None:
        self._store, self._executor, self._work = store, executor, work
        self._keys, self._recordings = store.known_rows()
        self._limits, self._tell = limits or EngineLimits(), tell
        self._ready: deque[Job] = deque()
        self._later: list[tuple[float, int, Job]] = []
        self._order, self._in_flight = count(), 0
        self._summary = RunSummary()

    def run(self, held: Sequence[Held]) -> RunSummary:
        """Process recordings with the joints that they hold; return a summary.

        Raises FleetError where the scheduler is lost, OSError where the store cannot be written.
        """
        self._joints = {bag.url: joints for bag, joints in held}
        unmapped = [bag.url for bag, joints in held if not joints]
        self._summary.unmapped, self._summary.example = len(unmapped), next(iter(unmapped), "")
        self._rate = Rate(sum(len(joints) for _, joints in held), self._tell)
        unseen = iter([bag for bag, joints in held if joints])
        while True:
            self._fill(unseen)
            if not self._in_flight and not self._later:
                break
            if (done := self._wait()) is not None:
                self._in_flight -= 1
                self._take(done)
        self._store.compact()
        return self._summary

    def _fill(self, unseen: Iterator[Bag]) -> None:
        """Put jobs in flight while the executor has places: those due again, those ready, then new ones.

        Of a recording that the store does not know, first its fingerprint is requested.
        """
        while self._in_flight < self._executor.places:
            if self._later and self._later[0][0] <= time.monotonic():
                job = heapq.heappop(self._later)[2]
            elif self._ready:
                job = self._ready.popleft()
            elif (bag := next(unseen, None)) is not None:
                recording = self._recordings.get((bag.url, bag.size, bag.stamp))
                if recording is None:
                    self._ready.append(Job(read_fingerprint, bag))
                else:
                    self._plan(bag, recording)
                continue
            else:
                return
            self._executor.submit(job)
            self._in_flight += 1

    def _wait(self) -> Done | None:
        """Return a job that is done; None when it is time to look whether one is due again."""
        until_due = max(0.0, self._later[0][0] - time.monotonic()) if self._later else _TURN
        if self._in_flight:
            return self._executor.next(min(until_due, _TURN))
        time.sleep(min(until_due, _TURN))
        return None

    def _plan(self, bag: Bag, recording: str) -> None:
        """Make the tasks of a recording that are new; one too large for any worker is a row at once."""
        for joint in self._joints[bag.url]:
            task = Task(bag, joint, recording, version(), self._limits.time, self._limits.pages)
            if task.key in self._keys:
                self._summary.before += 1
                self._rate.over(1, worked=False)
                continue
            self._keys.add(task.key)
            if why := self._too_large(bag):
                self._quarantine(task, why)
            else:
                self._ready.append(Job(self._work, task))

    def _too_large(self, bag: Bag) -> str:
        """Return why a recording is too large for a worker, empty where it is not."""
        need, limit = BASE + FACTOR * bag.size, self._limits.memory
        if limit is None or need <= limit:
            return ""
        size = f"{bag.size / 1e6:.4g} MB would take about {need / 1e9:.3g} GB"
        return f"{size}, a worker may have {limit / 1e9:.3g} GB: fewer workers or --memory, then --again"

    def _take(self, done: Done) -> None:
        """Write the outcome of a task, plan the task of a fingerprint, or try again."""
        job = done.job
        if isinstance(done.error, WorkerLost) and job.attempt + 1 < ATTEMPTS:
            due = time.monotonic() + self._limits.back_off * 2.0**job.attempt
            heapq.heappush(self._later, (due, next(self._order), replace(job, attempt=job.attempt + 1)))
        elif isinstance(job.argument, Task):
            self._take_task(job.argument, done)
        elif done.error is None:
            self._plan(*done.value)
        else:
            self._give_up(job.argument, done.error, len(self._joints[job.argument.url]))

    def _take_task(self, task: Task, done: Done) -> None:
        if done.error is None:
            self._put(done.value)
        elif isinstance(done.error, Changed):
            self._keys.discard(task.key)
            self._give_up(task.bag, done.error, 1)
        elif isinstance(done.error, WorkerLost):
            self._quarantine(task, f"its worker was lost all {ATTEMPTS} times (out of memory, or killed)")
        else:
            self._quarantine(task, f"{type(done.error).__name__}: {done.error}")

    def _give_up(self, bag: Bag, error: BaseException, tasks: int) -> None:
        """Leave a recording without a row to the next run."""
        self._rate.over(tasks, worked=False)
        if isinstance(error, Changed):
            self._summary.changed.append(bag.url)
        else:
            prefix = "" if isinstance(error, RseaError) else f"{bag.url}: {type(error).__name__}: "
            self._summary.unreadable.append(reason(f"{prefix}{error}"))

    def _quarantine(self, task: Task, why: str) -> None:
        self._put(TaskOutcome(task.row(outcome="quarantined", reason=reason(why))))

    def _put(self, outcome: TaskOutcome) -> None:
        row = outcome.row
        self._store.put(outcome)
        self._summary.outcomes[row["outcome"]] += 1
        self._summary.undated += row["outcome"] == "done" and row["time"] is None
        if row["outcome"] == "quarantined":
            self._summary.quarantined.append((row["joint"], row["bag"], row["reason"]))
        self._rate.over(1)


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
        return sum(self.outcomes.values())

    def sentence(self) -> str:
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

    def __init__(self, total: int, tell: Progress) -> None:
        self._total, self._tell, self._begin = total, tell, time.monotonic()
        self._over = self._worked = 0

    def over(self, count: int, *, worked: bool = True) -> None:
        """Count tasks that are over. worked: they took time now; else they were done before."""
        self._over += count
        self._worked += count if worked else 0
        self._tell(self.text(), self._over / self._total)

    def text(self) -> str:
        """Return `12/40, 3.4 a minute, 8 min left`."""
        begun = f"{self._over}/{self._total}"
        minutes = (time.monotonic() - self._begin) / 60.0
        if not self._worked or minutes <= 0.0:
            return begun
        rate = self._worked / minutes
        return f"{begun}, {rate:.3g} a minute, {duration((self._total - self._over) / rate)} left"


def duration(minutes: float) -> str:
    if minutes < 1.5:
        return f"{60.0 * minutes:.0f} s"
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
