"""Torque commands by the instant at which they take effect, with a watchdog."""

from __future__ import annotations

import math
import threading

MILLISECOND = 1_000_000
HORIZON = 300 * MILLISECOND
WATCHDOG = 50 * MILLISECOND


class CommandQueue:
    """What came on `torque_command`, until it is due. The executor's thread adds, the cycle's takes.

    A command takes effect at its stamp. One whose stamp is over takes effect at once (`late` counts them);
    one without a stamp, or further than 0.3 s from now, when it arrives (`unstamped`). Not-a-number is
    dropped (`refused`). 50 ms after the last command the torque is zero (`expired` counts how often).
    strict, as in front of a real machine: a stamp further than 0.3 s from now is `refused` too, unless there
    is none, and the last torque stays in force: to end it is the work of the machine's limits.
    """

    def __init__(self, *, strict: bool = False) -> None:
        self._strict = strict
        self._lock = threading.Lock()
        self._waiting: list[tuple[int, float]] = []
        self._taken_until = 0
        self._newest: int | None = None
        self.torque = 0.0
        self.late = self.unstamped = self.refused = self.expired = 0

    def add(self, stamp: int, torque: float, now: int) -> None:
        """Put in a command (N m) with its stamp; now: when it arrived, ns."""
        with self._lock:
            strange = self._strict and stamp != 0 and abs(stamp - now) > HORIZON
            if not math.isfinite(torque) or strange:
                self.refuse()
                return
            if abs(stamp - now) > HORIZON:
                self.unstamped += 1
                stamp = now
            elif stamp < self._taken_until:
                self.late += 1
            self._waiting.append((max(stamp, self._taken_until), torque))
            self._waiting.sort(key=lambda waiting: waiting[0])  # of one instant, the last that came counts

    def refuse(self) -> None:
        """Count a command that is none."""
        self.refused += 1

    def take(self, until: int) -> list[tuple[int, float]]:
        """Return the changes of torque up to an instant (ns), in order: (when, N m)."""
        with self._lock:
            changes = [w for w in self._waiting if w[0] <= until]
            self._waiting = self._waiting[len(changes) :]
            self._taken_until = until
            if changes:
                self._newest, self.torque = changes[-1]
            elif not self._strict and self._newest is not None and until - self._newest > WATCHDOG:
                self.expired += self.torque != 0.0
                changes = [(until, 0.0)] if self.torque != 0.0 else []
                self._newest, self.torque = None, 0.0
            return changes

    def age(self, now: int) -> float | None:
        """Return how long the command in force has been so, s; None when there is none."""
        return None if self._newest is None else (now - self._newest) / (1000 * MILLISECOND)

    def clear(self) -> None:
        """Forget all commands; the torque is zero."""
        with self._lock:
            self._waiting, self._newest, self.torque = [], None, 0.0

    def values(self, now: int) -> dict[str, object]:
        """Return it as diagnostics show it."""
        age = self.age(now)
        return {
            "command_age_ms": "none" if age is None else f"{age * 1e3:.1f}",
            "late_commands": self.late,
            "unstamped_commands": self.unstamped,
            "refused_commands": self.refused,
            "watchdog_trips": self.expired,
        }
