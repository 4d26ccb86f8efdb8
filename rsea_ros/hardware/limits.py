"""Limits of an actuator, the torque within them, and the fault that ends it until it is cleared."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Protocol, runtime_checkable

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.interlock import DeviceFault, Interlock, event
from rsea_ros.records.record import HUGE, NONSENSE, is_measured

COMMAND_TIMEOUT = "command_timeout"
HEARD_LATE = 3
"""Cycles until a torque that was written shows in the measured one."""
UNFELT = 1.0
"""s without a measurement of a limited quantity that are a fault: the longest ft_timeout of a sensor."""
CHANGEABLE = (
    "torque", "slew", "soft_start", "deflection", "velocity", "position", "ft", "power", "effort",
    "effort_time", "temperature", "current", "voltage", "command_timeout",
)  # fmt: skip
"""Quantities whose limit may change while the device is open."""
NO_LIMIT = {"temperature": math.inf, "current": math.inf, "voltage": 0.0}
"""Quantities that a device may not measure, and the limit that limits nothing."""


@dataclass(frozen=True)
class Limits:
    """SI. torque N m, slew N m/s, temperature °C, current A, voltage V (at least), velocity rad/s, position
    rad from its zero, ft N m about the actuator's axis, power W, measured, either way.

    deflection: rad, of the spring by a second encoder, otherwise of the drive's angle where that is
    the spring's.
    soft_start: N m/s, by which the largest torque grows after an activation and a fault.
    effort: N m by which the measured torque may miss the commanded one, for effort_time, s.
    command_timeout: s without a command while torque is commanded. ramp: s from then to zero torque.
    lost_cycles: cycles in a row without an answer, see Losses. ft_axis: place in the wrench.
    derived: what says so, of each limit that nobody stated (derive). unlikely: stated ones that are a
    hundredth of what is usual, in words.
    """

    torque: float
    slew: float = 10_000.0
    deflection: float = math.radians(5.0)
    temperature: float = 70.0
    current: float = math.inf
    voltage: float = 0.0
    command_timeout: float = 0.05
    ramp: float = 0.02
    lost_cycles: int = 3
    velocity: float = math.inf
    position: float = math.inf
    ft: float = math.inf
    power: float = math.inf
    soft_start: float = math.inf
    effort: float = math.inf
    effort_time: float = 0.1
    ft_axis: int = 5
    derived: Mapping[str, str] = field(default_factory=dict)
    unlikely: str = ""

    def __post_init__(self) -> None:
        """Raise ParameterError for a limit that limits nothing, as nan does, or is negative; inf is none."""
        for name, value in vars(self).items():
            if isinstance(value, Real) and not float(value) >= 0.0:
                raise ParameterError(f"limit {name} = {value}, expected a number of at least 0")

    def __str__(self) -> str:
        """Return the limits of torque, motion and motor, each derived one with its source."""
        units = {
            "torque": "N·m", "velocity": "rad/s", "position": "rad", "deflection": "rad", "ft": "N·m",
            "effort": "N·m", "current": "A", "voltage": "V",
        }  # fmt: skip
        parts = []
        for name, unit in units.items():
            value = getattr(self, name)
            source = f" ({self.derived[name]})" if name in self.derived else ""
            size = f"{value:.4g} {unit}" if math.isfinite(value) else "none"
            parts.append(f"{name}_limit {size}{source}")
        return ", ".join(parts)

    def without(self, names: Sequence[str]) -> "Limits":
        """Return limits that do not limit some quantities of NO_LIMIT."""
        return Limits(**{**vars(self), **{name: NO_LIMIT[name] for name in names}})


@dataclass(frozen=True)
class Rating:
    """What motor and sensor can do at most; inf: unknown.

    torque: N m, of the motor. velocity: rad/s, of the gear output without load. ft: N m, about the axis.
    current: A, of the motor. lowest, highest: V, of its supply. count: rad, the step of a measured position.
    """

    torque: float = math.inf
    velocity: float = math.inf
    ft: float = math.inf
    current: float = math.inf
    lowest: float = 0.0
    highest: float = math.inf
    count: float = 0.0


UNRATED = Rating()


@runtime_checkable
class Rated(Protocol):
    """A device that knows its rating, once it is open; others leave the limits to the rig."""

    @property
    def rating(self) -> Rating:
        """Return it."""


def unmeasured_quantities(limits: Limits, state: State) -> list[str]:
    """Return the quantities of NO_LIMIT that are limited and that a reading does not have."""
    return [
        name for name, none in NO_LIMIT.items()
        if getattr(limits, name) != none and not is_measured(getattr(state, name))
    ]  # fmt: skip


def loosened(limits: Limits, before: Limits) -> str:
    """Return the first changeable quantity that limits let further than others did, empty for none."""
    for name in CHANGEABLE:
        now, then = getattr(limits, name), getattr(before, name)
        if now < then if name == "voltage" else now > then:
            return name
    return ""


def ft_torque(limits: Limits, state: State) -> float:
    """Return the torque about the actuator's axis, N m; nan where the sensor measures none."""
    return math.nan if state.wrench is None else state.wrench[limits.ft_axis]


def complaint(limits: Limits, state: State, *, deflects: bool = False) -> DeviceFault | None:
    """Return the first fault in a reading. What is not measured (records.is_measured) is beyond no limit.

    deflects: whether the spring's deflection was measured before: then the drive's angle is none instead.
    """
    if not all(is_measured(value, HUGE) for value in (state.position, state.velocity, state.motor_torque)):
        reading = f"{state.position} rad, {state.velocity} rad/s, {state.motor_torque} N·m"
        return DeviceFault("reading", detail=f"{reading}, expected finite values up to {HUGE:g}")
    for cause, words in (
        ("hardware_error", state.hardware_error),
        ("motor_state", state.motor_trouble),
        ("ft", state.ft_trouble),
    ):
        if words:
            return DeviceFault(cause, detail=words)
    deflection = state.deflection if deflects or is_measured(state.deflection) else state.position
    for cause, value, limit, unit in (
        ("deflection", abs(deflection), limits.deflection, "rad"),
        ("temperature", state.temperature, limits.temperature, "°C"),
        ("current", abs(state.current), limits.current, "A"),
        ("velocity", abs(state.velocity), limits.velocity, "rad/s"),
        ("position", abs(state.position), limits.position, "rad"),
        ("ft_torque", abs(ft_torque(limits, state)), limits.ft, "N m"),
        ("power", abs(state.motor_torque * state.velocity), limits.power, "W"),
    ):
        if is_measured(value) and value > limit:
            return DeviceFault(cause, value, limit, unit)
    if is_measured(state.voltage) and state.voltage < limits.voltage:
        return DeviceFault("voltage", state.voltage, limits.voltage, "V", "too low")
    return None


class Guard:
    """Keeps the torque within limits, and at zero while the interlock has a fault or a stop.

    limited: commands that were cut.
    """

    def __init__(self, limits: Limits, period: float) -> None:
        self.limits, self._period = limits, period
        self.interlock = Interlock()
        self.limited = self.refused = 0
        self.torque = 0.0
        self._ramp = self._ramp_from = self._room = 0.0
        self._written: deque[float] = deque(maxlen=HEARD_LATE)
        self._missed = 0
        self._unfelt = {"ft": 0}

    @property
    def fault(self) -> DeviceFault | None:
        """The latched fault: the first one since it was cleared."""
        return self.interlock.fault

    def trip(self, fault: DeviceFault) -> None:
        """Latch a fault, unless there is one; any but late commands also ends the ramp of those."""
        if self.interlock.trip(fault):
            self._ramp_from = abs(self.torque)
            self._ramp = self._ramp_from * self._period / max(self.limits.ramp, self._period)
        elif fault.cause != COMMAND_TIMEOUT:
            self._ramp_from = 0.0

    def clear(self) -> None:
        """Clear the faults until now. The torque restarts softly from zero."""
        self.interlock.end_fault(event())
        self.restart()

    def restart(self) -> None:
        """Begin softly from zero torque."""
        self.torque, self._room, self._missed = 0.0, 0.0, 0
        self._written.clear()

    def look(self, state: State) -> None:
        """Latch the fault in a reading."""
        fault = self.complaint(state) or self._blind(state) or self._missing_torque(state.motor_torque)
        if fault is not None:
            self.trip(fault)

    def complaint(self, state: State) -> DeviceFault | None:
        """Return the first fault in a reading; once measured, a deflection is expected."""
        return complaint(self.limits, state, deflects="deflection" in self._unfelt)

    def _blind(self, state: State) -> DeviceFault | None:
        """Return a fault while a limit cannot be applied for too long, also once it was cleared.

        But for ft it counts if its quantity was measured before: `GuardedDevice.open` refuses others.
        """
        for name in ("ft", "deflection", *NO_LIMIT):
            if is_measured(ft_torque(self.limits, state) if name == "ft" else getattr(state, name)):
                self._unfelt[name] = 0
            elif getattr(self.limits, name) != NO_LIMIT.get(name, math.inf) and name in self._unfelt:
                self._unfelt[name] += 1
                if self._unfelt[name] * self._period > UNFELT:
                    quantity = "torque" if name == "ft" else name
                    detail = f"no {quantity} measured for {UNFELT:g} s, expected one for {name}_limit"
                    return DeviceFault(name, detail=detail)
        return None

    def allowed_torque(self, wanted: float, age: float | None) -> float:
        """Return the torque to write now (N m). age: of the command, s; None without a command.

        One from further ahead than command_timeout and a cycle is none: its clock is wrong.
        """
        limits = self.limits
        early = -max(limits.command_timeout, self._period)
        age = age if age is not None and math.isfinite(age) and age >= early else None
        if self.fault is None and age is not None and age > limits.command_timeout and self.torque != 0.0:
            self.trip(DeviceFault(COMMAND_TIMEOUT, 1e3 * age, 1e3 * limits.command_timeout, "ms"))
        if self.interlock.halted or self.interlock.stopped:
            self.torque = 0.0
        elif self.fault is None:
            self._open(age)
            is_command = age is not None and is_measured(wanted, NONSENSE * self.limits.torque)
            self.torque = self._within(wanted if is_command else 0.0)
            self.refused += age is not None and not is_command
        elif self.fault.cause == COMMAND_TIMEOUT:
            self.torque = math.copysign(self._ramp_limit(age), self.torque)
        else:
            self.torque = 0.0
        self.torque = min(max(self.torque, -limits.torque), limits.torque)  # of a limit that was lowered now
        self._written.append(self.torque)
        return self.torque

    def _ramp_limit(self, age: float | None) -> float:
        """Return the largest torque during the ramp: it falls with each cycle and with the time that passed.

        Cycles are late on a busy machine, and the torque of a dead publisher must not last as long as they.
        """
        over = 0.0 if age is None else age - self.limits.command_timeout
        left = 1.0 - max(0.0, over) / max(self.limits.ramp, self._period)
        return max(0.0, min(abs(self.torque) - self._ramp, self._ramp_from * left))

    def _open(self, age: float | None) -> None:
        """Let the largest torque grow while commands come; it restarts after they have ceased."""
        if age is None or age > self.limits.command_timeout:
            self._room = 0.0
        else:
            self._room = min(self._room + self.limits.soft_start * self._period, self.limits.torque)

    def _within(self, wanted: float) -> float:
        step = self.limits.slew * self._period
        torque = min(max(wanted, -self._room), self._room)
        torque = min(max(torque, self.torque - step), self.torque + step)
        self.limited += torque != wanted
        return torque

    def _missing_torque(self, measured: float) -> DeviceFault | None:
        """Return a fault when the motor has not made the written torque for too long."""
        if not self._written or self.fault is not None:
            return None
        low, high = min(self._written), max(self._written)
        off = max(low - measured, measured - high)
        self._missed = self._missed + 1 if off > self.limits.effort else 0
        if self._missed * self._period <= self.limits.effort_time:
            return None
        return DeviceFault("effort", off, self.limits.effort, "N m", "between commanded and measured torque")


def check_limits(limits: Limits, motor_limit: float, stiffness: float) -> None:
    """Compare limits with the motor's own torque limit (N m) and the spring of the rig (N m/rad).

    The torque limit at rest deflects the spring by torque / stiffness. Raises ParameterError. A derived one
    fits by itself.
    """
    if "torque" in limits.derived:
        return
    if limits.torque > motor_limit * (1.0 + 1e-9):
        raise ParameterError(
            f"parameter torque_limit = {limits.torque:g} N·m, expected at most {motor_limit:.4g} N·m,"
            " the motor's own limit"
        )
    if limits.torque / stiffness > limits.deflection:
        raise ParameterError(
            f"parameter torque_limit = {limits.torque:g} N·m deflects the rig's spring"
            f" of {stiffness:.4g} N·m/rad by {limits.torque / stiffness:.4g} rad,"
            f" expected at most deflection_limit = {limits.deflection:.4g} rad"
        )
