"""What the driver does in a cycle, without ROS: clock, commands, device."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rsea_ros.hardware.device import State
from rsea_ros.hardware.guarded import Guarded
from rsea_ros.hardware.limits import Fault
from rsea_ros.nodes._anchor import SECOND, Anchor
from rsea_ros.nodes._commands import CommandQueue

CLOCK_STEP, STOPPED = "clock_step", "stopped"


class Source(Protocol):
    """Where commands come from. commands: what has been polled."""

    commands: CommandQueue

    def poll(self, anchor: Anchor) -> None:
        """Put all commands that have arrived into the queue."""


class Drive:
    """A guarded device, driven by what a source has. rate: Hz. anchor: the clock of stamps and ages."""

    def __init__(self, guarded: Guarded, source: Source, anchor: Anchor, rate: float) -> None:
        self._guarded, self._source, self.anchor = guarded, source, anchor
        self._period = round(SECOND / rate)
        self._lock = threading.Lock()
        self._deaf = 0

    def step(self, stamp: int) -> State | None:
        """Write the command that is in force from this cycle on (its stamp rounded), read; None: no reading.

        stamp: the cycle's, ns since the epoch. One that was held up takes what is due by now.
        """
        with self._lock:
            stamp += self._see_to_the_clock()
            self._source.poll(self.anchor)
            commands, now = self._source.commands, self.anchor.now()
            commands.take(max(stamp, now - self._period) + self._period // 2)
            age = None if self._deaf else commands.age(now)
            return self._guarded.cycle(commands.torque, age)

    @contextmanager
    def deaf(self) -> Iterator[None]:
        """Let no command through while something is done to the device, also none that came meanwhile."""
        with self._lock:
            self._deaf += 1
        try:
            yield
        finally:
            with self._lock:
                self._source.poll(self.anchor)
                self._source.commands.clear(self.anchor.now())
                self._deaf -= 1

    def stop(self) -> None:
        """End the torque with the next cycle, until the fault is cleared; commands so far are forgotten."""
        with self.deaf():
            self._guarded.guard.trip(Fault(STOPPED, detail="the service stop was called"))

    def _see_to_the_clock(self) -> int:
        """Follow the system clock; return by how much it was set, ns.

        Where that was under torque nobody knows which commands are of now: it is a fault.
        """
        by = self.anchor.follow()
        if by:
            self._source.commands.shift(by)
            if self._guarded.guard.torque != 0.0:
                detail = f"the system clock was set by {by / SECOND:+.3f} s"
                self._guarded.guard.trip(Fault(CLOCK_STEP, detail=detail))
        return by
