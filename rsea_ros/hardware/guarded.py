"""A device behind its limits: every cycle checked, alone or together with others, lost samples counted."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import replace
from typing import Protocol

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import Device, NoReply, PortLost, Spring, State
from rsea_ros.hardware.interlock import DeviceFault, event
from rsea_ros.hardware.limits import UNRATED, Guard, Limits, Rated, Rating, loosened, unmeasured_quantities
from rsea_ros.hardware.protection import NONE, PROCESS
from rsea_ros.hardware.witnesses import Witnesses
from rsea_ros.records.record import is_measured


class Shared(Protocol):
    """A bus whose devices are written and read in one transaction."""

    def exchange(self) -> None:
        """Send written values, and fetch those to be read."""

    def send(self) -> None:
        """Send written values."""


def cycle(
    joints: Sequence[GuardedDevice],
    wanted: Sequence[tuple[float, float | None]],
    buses: Sequence[Shared] = (),
) -> list[State | None]:
    """Write the torques of all joints, then read all; return the reading of each, None of one without.

    wanted: torque (N m) and age of its command (s) of each, see GuardedDevice. A reading that trips a fault
    zeroes that joint's torque at once, and a motor that may not obey is switched off. The write comes first,
    so that a command takes effect as near to the start of its cycle as can be. A joint whose device is being
    switched, cleared or rebooted is left out, and holds up no other.
    """
    with ExitStack() as kept:
        taken = [joint.take(kept) for joint in joints]
        before = [joint.fault for joint in joints]
        for joint, is_taken, (torque, age) in zip(joints, taken, wanted, strict=True):
            if is_taken:
                joint.write(torque, age)
        for bus in buses:
            bus.exchange()
        states = [joint.read() if is_taken else None for joint, is_taken in zip(joints, taken, strict=True)]
        for joint, is_taken, fault, (_, age) in zip(joints, taken, before, wanted, strict=True):
            if is_taken and joint.fault is not fault:
                joint.write(0.0, age)
        for bus in buses:
            bus.send()
        for joint, state in zip(joints, states, strict=True):
            if state is not None:
                joint.switch_off_if_due()
        return states


WINDOW, SHARE = 10, 0.5
"""Answers that are looked at, as a multiple of those that are a fault in a row, and the part of them."""


class Losses:
    """Lost answers of one kind of transaction. limit: cycles in a row that are a fault."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._recent: deque[bool] = deque(maxlen=WINDOW * limit)
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._recent.clear()
        self._in_a_row = self._count = 0

    def take_back(self) -> None:
        """Count the last answer, which was lost, as one that came after all."""
        if self._recent and self._recent[-1]:
            self._recent[-1] = False
            self._count -= 1
        self._in_a_row = 0

    def take(self, *, lost: bool) -> DeviceFault | None:
        """Take in whether the answer of a cycle was lost; return the fault that it is."""
        if len(self._recent) == self._recent.maxlen:
            self._count -= self._recent[0]
        self._recent.append(lost)
        self._count += lost
        self._in_a_row = self._in_a_row + 1 if lost else 0
        if self._in_a_row >= self._limit:
            return DeviceFault("no_reply", self._in_a_row, self._limit, "cycles")
        most = math.ceil(SHARE * WINDOW * self._limit)
        if lost and self._count >= most:
            return DeviceFault("no_reply", self._count, most, "cycles", f"of the last {len(self._recent)}: ")
        return None


BUSY = "clear_fault or reboot is under way, expected it to be over"
STOPPED = DeviceFault("stopped", detail="the service stop was called")
UNOBEYED = {
    "motor_state", "effort", "velocity", "position", "position_step", "deflection", "ft_torque", "power",
    "current",
}  # fmt: skip
"""Causes after which the motor is switched off: a goal of zero stops one in another mode not at all."""
PATIENCE = 10
"""Times the lost answers of a fault that a reading at configure or in clear_fault may lose."""
AGAIN = 0.25
"""s after which a port that was lost is tried again."""
STEP, COUNTS = 2.0, 2.0
"""Times the velocity limit, and steps of the reading besides, one at either end: a position that changes by
more has jumped; the fault `velocity` comes before."""


class GuardedDevice:
    """Reads and writes once a cycle; errors become latched faults, never exceptions.

    interlock: fault, stop and activity. cycles: `failed_reads`, `failed_writes` of the cycles so far.
    away: whether another thread uses the device for longer than a cycle; cycles then leave it alone.
    lifted: limits that do not apply, of what a simulation does not have.
    spring: turns a measured deflection into a wrench where no sensor measures one; None: no such wrench.
    derive: returns the limits for what motor and sensor can do, known once it is open; None: `limits`.
    testify: returns likewise what holds the wrench against deflection and motor torque; None: nobody does.
    """

    def __init__(
        self, device: Device, limits: Limits, rate: float, spring: Spring | None = None,
        derive: Callable[[Rating], Limits] | None = None,
        testify: Callable[[Rating], Witnesses | None] = lambda rating: None,
    ) -> None:  # fmt: skip
        self.device, self.guard = device, Guard(limits, 1.0 / rate)
        self._limits, self._period, self._rating = limits, 1.0 / rate, UNRATED
        self._spring, self._derive, self._testify = spring, derive, testify
        self._witnesses: Witnesses | None = None
        self.interlock = self.guard.interlock
        self.cycles: Counter[str] = Counter()
        self.state: State | None = None
        self.lifted: list[str] = []
        self.away = self._inferred = self._off = self._off_due = False
        self._reached, self._jumped, self._moved = -math.inf, 0.0, 0.0
        self._turn, self._tare = threading.Lock(), threading.Lock()
        self._losses = {transfer: Losses(limits.lost_cycles) for transfer in ("read", "write")}

    @property
    def fault(self) -> DeviceFault | None:
        """The latched fault, or the stop."""
        return self.guard.fault or (STOPPED if self.interlock.stopped else None)

    @property
    def is_off(self) -> bool:
        """Whether the motor has acknowledged that its torque is off, since it was on and since a stop."""
        return self._off and not (self.away or self._off_due)

    @property
    def enabled(self) -> bool:
        """Whether it is active: commands pass unless there is a fault."""
        return self.interlock.enabled

    def open(self, *, unprotected: bool = False) -> None:
        """Open the device; check its protection against a dead host, and that each limit can be applied.

        unprotected: whether protection may be missing. Raises ParameterError for a device without it
        otherwise and for a limit of what it does not measure or cannot do, DeviceError; nothing stays open.
        """
        self.device.open()
        self.state, self._inferred, self.guard.limits = None, False, self._limits
        self._off, self._off_due, self._jumped, self._moved = True, False, 0.0, 0.0
        for losses in self._losses.values():
            losses.clear()
        try:
            self._check_protection(unprotected=unprotected)
            self._rating = self.device.rating if isinstance(self.device, Rated) else UNRATED
            if self._derive is not None:
                self._limits = self._derive(self._rating)
            self._witnesses = self._testify(self._rating)
            self._check_measured()
        except Exception:
            self.device.close()
            raise
        self.guard.clear()

    def _check_protection(self, *, unprotected: bool) -> None:
        if self.device.protection.kind == NONE and not unprotected:
            raise ParameterError(
                "nothing ends the torque of this device when the driver's process dies: dead-host protection"
                " none, expected a bus watchdog or a supervisor, or parameter"
                " allow_no_dead_host_protection = true"
            )

    def _check_measured(self) -> None:
        """Raise ParameterError for a limit of a quantity that the device does not measure.

        In a simulation, whose torque is its process's own, nothing gets hot: such limits are lifted.
        """
        lacking = unmeasured_quantities(self._limits, self._patiently())
        simulated = self.device.protection.kind == PROCESS
        if lacking and not simulated:
            name = lacking[0]
            raise ParameterError(
                f"parameter {name}_limit = {getattr(self._limits, name):g} cannot be applied: the device"
                f" measures no {name}, expected 0 for none"
            )
        self.lifted = lacking
        self.guard.limits = self._limits.without(lacking)

    def limit(self, names: Sequence[str]) -> None:
        """Take over what `derive` returns now for some quantities: lower ones from the next cycle on.

        Raises ParameterError for one that is raised under torque, or beyond what `open` has checked.
        """
        derived = self._limits if self._derive is None else self._derive(self._rating)
        told = {name: text for name, text in self.guard.limits.derived.items() if name not in names}
        told |= {name: derived.derived[name] for name in names if name in derived.derived}
        changed = {name: getattr(derived, name) for name in names if name not in self.lifted}
        limits = replace(self.guard.limits, **changed, derived=told)
        checked = self._limits.without(self.lifted)
        if name := loosened(limits, checked):
            most = "least" if name == "voltage" else "most"
            raise ParameterError(
                f"{name} = {getattr(limits, name):g}, expected at {most} {getattr(checked, name):.4g},"
                " what configure has checked, or cleanup first"
            )
        with self._turn if loosened(limits, self.guard.limits) else nullcontext():
            if self.enabled and (name := loosened(limits, self.guard.limits)):
                raise ParameterError(f"{name} is raised while active, expected deactivate first")
            self.guard.limits = limits

    def cycle(self, wanted: float, age: float | None) -> State | None:
        """Do a cycle of this device alone, see `cycle`."""
        return cycle([self], [(wanted, age)])[0]

    def measures_deflection(self) -> bool:
        """Return whether a reading has the spring's deflection; False also if the device does not answer."""
        try:
            return is_measured(self._patiently().deflection)
        except DeviceError:
            return False

    def take(self, kept: ExitStack) -> bool:
        """Take the device until `kept` ends, for a cycle of several; False where somebody else has it."""
        if not self._turn.acquire(blocking=False):
            return False
        kept.callback(self._turn.release)
        return not self.away

    def read(self) -> State | None:
        """Return the reading of this cycle; None without one."""
        try:
            self.device.protection.beat()  # to wait for a reply that is lost is not to hang
            state = self._read()
        except DeviceError as error:
            self._count_failure("read", error)
            self._reach_again(error)
            return None
        self._losses["read"].take(lost=False)
        if state.acknowledged_late:
            self._losses["write"].take_back()
        latched = self.guard.fault
        if fault := self._follow(state):
            self.guard.trip(fault)
        self.guard.look(state)
        if self._witnesses and (fault := self._witnesses.take(state, self.guard.torque)):
            self.guard.trip(fault)
        fault = self.guard.fault
        if state.motor_trouble or (fault is not None and fault is not latched and fault.cause in UNOBEYED):
            self._off_due = True
        return state

    def _follow(self, state: State) -> DeviceFault | None:
        """Take a reading for the newest; return the fault of a position that has jumped meanwhile."""
        before, self.state = self.state, state
        if before is None:
            return None
        time = max(1e-9 * (state.stamp - before.stamp), self._period)
        step, most = state.position - before.position, self._furthest(time)
        if not abs(step) > most:
            return None
        self._jumped, self._moved = self._jumped + step, self._moved + most
        if abs(self._jumped) <= self._moved:  # it is back, but for what may have been motion, as of a spring
            self._jumped = self._moved = 0.0
        return DeviceFault("position_step", abs(step), most, "rad", f"in {time:.3g} s")

    def _furthest(self, time: float) -> float:
        """Return what a position may change by within a time, rad."""
        return STEP * self.guard.limits.velocity * time + COUNTS * self._rating.count

    def _reach_again(self, error: DeviceError) -> None:
        """Switch a motor off as soon as a port that was lost is back: it goes on with its last goal."""
        now = time.monotonic()
        if isinstance(error, PortLost) and now - self._reached > AGAIN:
            self._reached = now
            with suppress(DeviceError):
                self.device.recover()

    def switch_off_if_due(self) -> None:
        """Switch a motor off that may not obey its goal, after a cycle in which it answered."""
        if self._off_due:
            with suppress(DeviceError):
                self._switch_off()

    def write(self, wanted: float, age: float | None) -> float:
        """Write a torque (N m) within the limits, zero when not enabled; return it. age: see Guard."""
        torque = self.guard.allowed_torque(wanted, age if self.enabled and not self._tare.locked() else None)
        try:
            if torque != 0.0:
                self.device.protection.beat(True)
            self.device.write(torque)
            if torque == 0.0:
                self.device.protection.beat(False)
        except DeviceError as error:
            self._count_failure("write", error)
        else:
            self._losses["write"].take(lost=False)
        return torque

    def enable(self) -> None:
        """Switch the torque on, at zero. Raises DeviceError with a fault or a stop, also one that comes."""
        asked = event()
        self.interlock.check()
        with self._turn:
            if self.away:
                raise DeviceError(BUSY)
            self.guard.restart()
            try:
                self._switch_on()
                self.interlock.enable(asked)
            except DeviceError:
                with suppress(DeviceError):
                    self._switch_off()
                raise

    def stop(self, *, is_answered: bool = True) -> None:
        """Zero the torque and switch it off in the next cycle, until a later clear. See Interlock.stop."""
        self.interlock.stop(is_answered=is_answered)
        self._off_due = True

    def disable(self) -> None:
        """Command zero torque and switch it off. The thread that uses the device does it while it is away."""
        self.interlock.disable()
        with self._turn:
            self.guard.torque = 0.0
            if not self.away:
                self._switch_off()

    def zero_ft(self) -> None:
        """Tare the F/T sensor, beside the cycles. Raises DeviceError under torque and beside another one."""
        if self.guard.torque != 0.0:
            raise DeviceError(f"zero_ft: {self.guard.torque:.4g} N·m is commanded, expected 0 N·m")
        if not self._tare.acquire(blocking=False):
            raise DeviceError("zero_ft: another one is under way, expected it to be over")
        try:
            self.device.zero_ft()
        finally:
            if self._witnesses:
                self._witnesses.restart()
            self._tare.release()

    def clear(self, asked: int | None = None) -> bool:
        """Reconnect if necessary, end fault and stop; return whether there was one.

        asked: the number of the request's event, which ends no later stop; None: now.
        Raises DeviceError while the cause is present, checked by a reading, and for what came meanwhile.
        """
        if self.fault is None:
            return False
        asked = event() if asked is None else asked
        self._alone(self._recover, asked)
        return True

    def reboot(self) -> None:
        """Restart the actuator; the fault is forgotten, not a stop; the torque is on as before, at zero.

        Raises DeviceError, with a fault latched and the torque off, where a reading has a fault all the same.
        """
        self.guard.torque = 0.0
        self._alone(self._reboot)

    def _reboot(self) -> None:
        self._switch_off()
        self.device.reboot()
        self._check()

    def _recover(self) -> None:
        if self.guard.torque != 0.0:  # of a ramp, which no cycle goes on with meanwhile
            self.guard.torque = 0.0
            with suppress(DeviceError):
                self._switch_off()
        self.device.recover()
        self._check()

    def _check(self) -> None:
        """Raise DeviceError where a reading has a fault, which is latched."""
        state = self._patiently()
        fault = self._follow(state) or self.guard.complaint(state)
        if fault is not None:
            self.guard.trip(fault)
            raise DeviceError(f"{fault} is still there, expected it to be over")
        if self._jumped:
            raise DeviceError(f"position jumped by {self._jumped:.3g} rad, expected cleanup and configure")

    def _switch_on(self) -> None:
        self._off = self._off_due = False
        self.device.enable()

    def _switch_off(self) -> None:
        """Zero the torque and switch it off; a motor that does not acknowledge it still owes it."""
        self._off_due = True
        self.device.disable()
        self.device.protection.beat(False)
        self._off, self._off_due = True, False

    @property
    def contradiction(self) -> str:
        """What speaks against the wrench, in words; empty where nothing does."""
        return self._witnesses.words if self._witnesses else ""

    @property
    def ft_source(self) -> str:
        """Where the wrench of the newest reading comes from, in words."""
        if self.state is None or self.state.wrench is None:
            return "none"
        return f"{self._spring}" if self.state.inferred and self._spring else "sensor"

    def _read(self) -> State:
        """Return a reading, with the spring's torque where only the deflection is measured."""
        state = self.device.read()
        if self._spring is None:
            return state
        state = self._spring.with_wrench(state)
        if self._inferred and not state.inferred:
            return replace(state, ft_trouble="the spring's deflection is not measured any more")
        self._inferred = state.inferred
        return state

    def _patiently(self) -> State:
        """Return a reading outside of the cycles, of which more answers may be lost than within them."""
        for _ in range(PATIENCE * self.guard.limits.lost_cycles - 1):
            with suppress(NoReply):
                return self._read()
        return self._read()

    def _alone(self, work: Callable[[], None], asked: int = 0) -> None:
        """Use the device while the cycles leave it alone, then restart at zero torque.

        asked: the number of a request that ends stops; 0: none. What fails leaves a fault, and the motor off
        as soon as it answers.
        """
        with self._turn:
            if self.away:
                raise DeviceError(BUSY)
            self.away, began = True, event()
        try:
            work()
            for losses in self._losses.values():
                losses.clear()
            if self.enabled:
                self._switch_on()
            self.guard.restart()
            self.interlock.end_fault(began)
            if asked:
                self.interlock.end_stop(asked)
        except Exception as error:
            self._off_due = True
            if self.fault is None:
                self.guard.trip(DeviceFault("reboot", detail=f"failed: {error}"))
            raise
        finally:
            with self._turn:
                if self.interlock.stopped:
                    self._off_due = True
                self.away = False
                if not self.enabled:  # also where it was requested meanwhile
                    with suppress(DeviceError):
                        self._switch_off()

    def _count_failure(self, transfer: str, error: DeviceError) -> None:
        """Count a failure. One lost answer costs a cycle; many of them, and any other failure, trip."""
        self.cycles[f"failed_{transfer}s"] += 1
        if not isinstance(error, NoReply):
            self.guard.trip(DeviceFault(type(error).__name__.lower(), detail=str(error)))
        elif fault := self._losses[transfer].take(lost=True):
            self.guard.trip(replace(fault, detail=fault.detail + str(error)))
