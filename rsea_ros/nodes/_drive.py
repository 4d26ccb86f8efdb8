"""Driving a device: cycles."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Protocol

from rsea_ros.hardware.device import State
from rsea_ros.hardware.guarded import GuardedDevice, Shared, cycle
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.nodes._commands import CommandQueue
from rsea_ros.nodes._cycle import SECOND, Anchor

CLOCK_STEP, RESTARTED = "clock_step", "restarted"
REST = 1.0
"""s without a torque from the first command on, which a stream that is on and off at 1 Hz does not have."""


class CommandSource(Protocol):
    """The source of commands. commands: the polled ones."""

    commands: CommandQueue

    def poll(self, anchor: Anchor) -> None:
        """Put all commands that have arrived into the queue."""


class DriverCycle:
    """A guarded device, driven by a source's commands. rate: Hz. anchor: the clock of stamps and ages.

    lock: held while a cycle takes a command and the device gets it. zero_first: whether a torque of a stream
    without a REST is a fault: nobody has asked for it since the driver died and was started again.
    """

    def __init__(self, guarded: GuardedDevice, source: CommandSource, anchor: Anchor, rate: float) -> None:
        self.guarded, self._source, self.anchor = guarded, source, anchor
        self._period = round(SECOND / rate)
        self.lock = threading.Lock()
        self._deaf, self.zero_first = 0, False

    def wanted_torque(self, stamp: int, by: int) -> tuple[float, float | None]:
        """Return the torque (N m) that is in force from this cycle on (its stamp rounded), and its age (s).

        stamp: the cycle's, ns since the epoch. A delayed cycle takes the command due by now.
        by: ns by which the clock was set since the last cycle.
        """
        self._see_to_the_clock(by)
        self._source.poll(self.anchor)
        commands, now = self._source.commands, self.anchor.now()
        commands.take(max(stamp, now - self._period) + self._period // 2)
        if self.zero_first and commands.first is not None and not self._deaf:
            self.zero_first = False
            rest, torque = commands.first[0] / SECOND, commands.first[1]
            if rest < REST:
                detail = (
                    f"the first torque since autostart, {torque:.4g} N·m, came {rest:.3g} s after the first"
                    f" command, expected {REST:g} s of 0 N·m or resume:=true"
                )
                self.guarded.guard.trip(DeviceFault(RESTARTED, detail=detail))
        return commands.torque, None if self._deaf else commands.age(now)

    @contextmanager
    def deaf(self) -> Iterator[None]:
        """Let no command through while something is done to the device, also none that came meanwhile."""
        with self.lock:
            self._deaf += 1
        try:
            yield
        finally:
            with self.lock:
                self._source.poll(self.anchor)
                self._source.commands.clear(self.anchor.now())
                self._deaf -= 1

    def stop(self) -> None:
        """End the torque with the next cycle, until a later clear; commands so far are forgotten."""
        with self.deaf():
            self.guarded.stop()

    def _see_to_the_clock(self, by: int) -> None:
        """Drop the commands from before the system clock was set: nobody knows which are of now.

        Where it was set under torque it is a fault.
        """
        if by:
            self._source.commands.shift(by)
            self._source.poll(self.anchor)
            self._source.commands.clear(self.anchor.now())
            if self.guarded.guard.torque != 0.0:
                detail = f"the system clock was set by {by / SECOND:+.3f} s"
                self.guarded.guard.trip(DeviceFault(CLOCK_STEP, detail=detail))


def step(drives: Sequence[DriverCycle], stamp: int, buses: Sequence[Shared] = ()) -> list[State | None]:
    """Do a cycle of joints that share an anchor; return the reading of each, None where it has none.

    stamp: the cycle's, ns since the epoch. buses: through which several joints are written and read.
    """
    with ExitStack() as kept:
        for drive in drives:
            kept.enter_context(drive.lock)
        by = drives[0].anchor.follow()
        wanted = [drive.wanted_torque(stamp + by, by) for drive in drives]
        return cycle([drive.guarded for drive in drives], wanted, buses)
