"""A safety monitor at the motor, which knows goal, enable and one rule, and a driver for it to watch."""

from __future__ import annotations

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.protection import BUS_WATCHDOG, Protection
from rsea_ros.nodes._commands import CommandQueue
from rsea_ros.nodes._cycle import SECOND, Anchor
from rsea_ros.nodes._drive import DriverCycle, step

LONGEST = WATCHDOG = 0.1
"""s after which a command no longer excuses a torque; of the motor's own watchdog."""


class Monitor:
    """No torque unless active, commanded in the last 100 ms, without fault. violations: (s, why)."""

    def __init__(self):
        self.active, self.fault_since, self.commanded = False, None, -1e9
        self.violations = []

    def look(self, now, goal, on, grace=0.0):
        """Judge what acts at an instant (s). grace: s that a fault may act on while its cycle goes on."""
        if goal == 0.0 or not on:
            return
        if not self.active:
            self.violations.append((now, "not active"))
        elif now - self.commanded > LONGEST:
            self.violations.append((now, f"commanded {now - self.commanded:.3f} s ago"))
        elif self.fault_since is not None and now - self.fault_since > grace:
            self.violations.append((now, "fault"))


class FakeMotor:
    """A device without a wire that makes its torque at once. during: done in each recover."""

    protection = Protection(BUS_WATCHDOG, WATCHDOG)

    def __init__(self):
        self.goal, self.on, self.away, self.refusing = 0.0, False, False, ""
        self.reading = {}
        self.during = None
        self._heard, self._once = 0.0, {}

    def at(self, moment, act):
        """Act within the next call of a method; return a list that has its name once that is done."""
        self._once[moment] = act, []
        return self._once[moment][1]

    def _reached(self, moment):
        act, done = self._once.pop(moment, (lambda: None, []))
        done.append(moment)
        act()

    def watch(self, now):
        """The motor's own watchdog: without a host for 100 ms its goal is zero."""
        self._heard = self._heard if self.away else now
        if now - self._heard > WATCHDOG:
            self.goal = 0.0

    def _answer(self):
        if self.away:
            raise NoReply("no reply")

    def open(self):
        self._answer()

    def enable(self):
        self._reached("enable")
        self._answer()
        self.goal, self.on = 0.0, True

    def disable(self):
        self._reached("disable")
        self._answer()
        self.goal, self.on = 0.0, False

    def read(self):
        self._reached("read")
        self._answer()
        made = self.goal if self.on else 0.0
        return State(0, **({"position": 0.0, "velocity": 0.0, "motor_torque": made} | self.reading))

    def write(self, torque):
        self._answer()
        self.goal = torque

    def zero_ft(self):
        pass

    def recover(self):
        self._reached("recover")
        if self.during:
            self.during()
        self._answer()
        if self.refusing:
            raise DeviceError(self.refusing)

    def reboot(self):
        self.disable()
        self.recover()

    def health(self):
        return {}

    def close(self):
        self.goal, self.on = 0.0, False


class World:
    """A driver's cycles on clocks that the test sets. wall - steady: how far the system clock was set."""

    RATE = 280.0

    def __init__(self, **limits):
        self.steady, self.off = 5 * SECOND, 1_700_000_000 * SECOND
        self.motor, self.commands, self.inbox = FakeMotor(), CommandQueue(strict=True), []
        self.anchor = Anchor(lambda: self.steady + self.off, lambda: self.steady)
        defaults = {"soft_start": 500.0, "slew": 10_000.0, "effort": 6.0}
        self.guarded = GuardedDevice(self.motor, Limits(68.0, **(defaults | limits)), self.RATE)
        self.drive = DriverCycle(self.guarded, self, self.anchor, self.RATE)
        self.monitor, self.polled = Monitor(), 0
        self.torques = []

    @property
    def seconds(self):
        """The monotonic clock."""
        return self.steady / SECOND

    def wall(self):
        """The system clock, ns."""
        return self.steady + self.off

    def poll(self, anchor):
        """Pass the sent commands to the driver, as a bench does."""
        for stamp, torque, received in self.inbox:
            self.commands.add(stamp, torque, anchor.arrival(received, self.polled))
        self.inbox, self.polled = [], anchor.now()

    def activate(self):
        """Switch the torque on."""
        with self.drive.deaf():
            self.guarded.enable()
        self.monitor.active = True

    def send(self, torque, ahead=0.0):
        """Publish a command stamped with the system clock."""
        self.inbox.append((self.wall() + round(ahead * SECOND), torque, self.wall()))
        self.monitor.commanded = self.seconds + ahead

    def cycle(self, torque=None):
        """A cycle later, with a command sent before it."""
        self.steady += round(SECOND / self.RATE)
        if torque is not None:
            self.send(torque)
        step([self.drive], self.anchor.now())
        self.motor.watch(self.seconds)
        since = self.monitor.fault_since or self.seconds
        self.monitor.fault_since = None if self.guarded.fault is None else since
        grace = (WATCHDOG if self.motor.away else self.guarded.guard.limits.ramp) + 2.0 / self.RATE
        self.monitor.look(self.seconds, self.motor.goal, self.motor.on, grace)
        self.torques.append(self.motor.goal)
        return self.motor.goal

    def cycles(self, count, torque=None):
        """Several; the torques that acted."""
        return [self.cycle(torque) for _ in range(count)]
