"""Torque commands by the instant at which they take effect, with a watchdog."""

import math
import threading
import time
from typing import NamedTuple

from rsea_ros.nodes._cycle import SECOND
from rsea_ros.records.record import NONSENSE, is_measured

MILLISECOND = SECOND // 1000
HORIZON = 300 * MILLISECOND
WATCHDOG = 50 * MILLISECOND


class Obeyed:
    """One publisher of torques at a time. ignored: messages of others while that one goes on."""

    def __init__(self) -> None:
        self._who: object = None
        self._heard = 0
        self.ignored = 0

    def admit(self, who: object, now: int | None = None) -> bool:
        """Return whether a message of a publisher (by identity) counts. now: ns, of a clock without steps."""
        now = time.monotonic_ns() if now is None else now
        if who != self._who and self._who is not None and now - self._heard < HORIZON:
            self.ignored += 1
            return False
        self._who, self._heard = who, now
        return True


class PendingCommand(NamedTuple):
    """A command until it is due: when it takes effect, when it came, and its stamp, ns; torque N m."""

    when: int
    torque: float
    arrival: int
    stamp: int


class CommandQueue:
    """Messages of `torque_command` until they are due. One thread adds, another may take.

    Instants are ns on a clock that never jumps and has the system clock's time (Anchor).
    A command takes effect at its stamp. One whose stamp is past takes effect at once (`late` counts them,
    `lateness` is the largest, ns, since it was set to 0); `ahead` counts those that came before their stamp.
    one without a stamp, or further than 0.3 s from now, when it arrives (`unstamped`, of these `off` by
    their stamp). A command that takes effect at once overtakes earlier waiting ones. One that is not finite,
    or beyond NONSENSE times the limit, is dropped (`refused`). 50 ms after the last command the torque is
    zero (`expired` counts how often).
    first: the first that is not zero since the last `clear`, whether it ever took effect or not: how long
    after the first of all it came (ns), and N m. stamp: ns, of the torque in force, also where that came too
    late for it.
    strict, as in front of a real machine: a stamp further than 0.3 s from now is `refused` too, unless there
    is none, and the last torque stays in force: the machine's limits end it.
    """

    def __init__(self, *, strict: bool = False, limit: float = math.inf) -> None:
        """limit: the largest torque, N m; NONSENSE times that is no command but an error of its sender."""
        self._strict, self._most = strict, NONSENSE * limit
        self._lock = threading.Lock()
        self._waiting: list[PendingCommand] = []
        self._taken_until = self._from = 0
        self._newest: int | None = None
        self.stamp, self.torque, self.furthest = 0, 0.0, 0.0
        self._began: int | None = None
        self.first: tuple[int, float] | None = None
        self.ahead = self.lateness = 0
        self.late = self.unstamped = self.off = self.refused = self.expired = self.dropped = 0

    def add(self, stamp: int, torque: float, now: int) -> None:
        """Put in a command (N m) with its stamp; now: when it arrived, ns."""
        with self._lock:
            if now < self._from:
                self.dropped += 1
                return
            strange = stamp != 0 and abs(stamp - now) > HORIZON
            if strange:
                self.off, self.furthest = self.off + 1, (stamp - now) / SECOND
            if not is_measured(torque, self._most) or (self._strict and strange):
                self.refuse()
                return
            if abs(stamp - now) > HORIZON:
                self.unstamped += 1
                stamp = now
            elif stamp < self._taken_until:
                self.late, self.lateness = self.late + 1, max(self.lateness, now - stamp)
            self.ahead += stamp > now
            self._began = now if self._began is None else self._began
            if self.first is None and torque != 0.0:
                self.first = now - self._began, torque
            if stamp <= now:
                self._waiting = [w for w in self._waiting if w.when <= now]
            self._waiting.append(PendingCommand(max(stamp, self._taken_until), torque, now, stamp))
            self._waiting.sort(key=lambda waiting: waiting.when)  # of one instant, the last that came counts

    def refuse(self) -> None:
        """Count an invalid command."""
        self.refused += 1

    def take(self, until: int) -> list[tuple[int, float]]:
        """Return the changes of torque up to an instant (ns), in order: (when, N m)."""
        with self._lock:
            due = [w for w in self._waiting if w.when <= until]
            changes = [(w.when, w.torque) for w in due]
            self._waiting = self._waiting[len(due) :]
            self._taken_until = until
            if due:
                self.torque, self.stamp = due[-1].torque, due[-1].stamp
                self._newest = max(due[-1].when, due[-1].arrival)
            elif not self._strict and self._newest is not None and until - self._newest > WATCHDOG:
                self.expired += self.torque != 0.0
                changes = [(until, 0.0)] if self.torque != 0.0 else []
                self._newest, self.torque, self.stamp = None, 0.0, until
            return changes

    def age(self, now: int) -> float | None:
        """Return how long the present command has been in force, s; None without one.

        Counted from its arrival, or from its stamp if it came ahead of it.
        """
        return None if self._newest is None else (now - self._newest) / SECOND

    def shift(self, by: int) -> None:
        """Shift all instants by a number of ns, after their clock was re-anchored."""
        with self._lock:
            waiting, self.stamp = self._waiting, self.stamp + by
            self._waiting = [
                PendingCommand(w.when + by, w.torque, w.arrival + by, w.stamp + by) for w in waiting
            ]
            self._taken_until, self._from = self._taken_until + by, self._from + by
            self._newest = None if self._newest is None else self._newest + by

    def clear(self, since: int = 0) -> None:
        """Drop all commands; the torque is zero. since: ns; commands from before are dropped also later."""
        with self._lock:
            self._waiting, self._newest, self.torque = [], None, 0.0
            self._began = self.first = None
            self._from = max(self._from, since)

    def values(self, now: int) -> dict[str, object]:
        """Return it as diagnostics show it."""
        age = self.age(now)
        return {
            "command_age_ms": "none" if age is None else f"{age * 1e3:.1f}",
            "late_commands": self.late,
            "unstamped_commands": self.unstamped,
            "refused_commands": self.refused,
            "dropped_commands": self.dropped,
            "watchdog_trips": self.expired,
        }
