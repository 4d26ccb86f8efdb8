"""What an actuator may do: limits, the torque within them, and the fault that ends it until it is cleared."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import State

COMMAND_TIMEOUT = "command_timeout"


@dataclass(frozen=True)
class Limits:
    """SI. torque N m, slew N m/s, deflection rad, temperature °C, current A, voltage V (at least).

    command_timeout: s without a command while torque is commanded. ramp: s from there to zero torque.
    lost_cycles: cycles in a row without an answer.
    """

    torque: float
    slew: float = 40_000.0
    deflection: float = math.radians(5.0)
    temperature: float = 70.0
    current: float = math.inf
    voltage: float = 0.0
    command_timeout: float = 0.05
    ramp: float = 0.02
    lost_cycles: int = 3


@dataclass(frozen=True)
class Fault:
    """Why there is no torque: cause, value, limit, unit; detail: in words."""

    cause: str
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""
    detail: str = ""

    def __str__(self) -> str:
        measured = f" {self.value:.4g} {self.unit}, limit {self.limit:.4g} {self.unit}"
        return f"{self.cause}:" + ("" if math.isnan(self.value) else measured) + f" {self.detail}".rstrip()


class Guard:
    """Keeps the torque within limits, and at zero once a fault is latched.

    fault: the first one since it was cleared. limited: commands that were cut down.
    """

    def __init__(self, limits: Limits, period: float) -> None:
        self.limits, self._period = limits, period
        self.fault: Fault | None = None
        self.limited = 0
        self.torque = 0.0
        self._ramp = 0.0

    def trip(self, fault: Fault) -> None:
        """Latch a fault, unless there is one."""
        if self.fault is None:
            self.fault = fault
            self._ramp = abs(self.torque) * self._period / max(self.limits.ramp, self._period)

    def clear(self) -> None:
        """Forget the fault. The torque begins at zero."""
        self.fault, self.torque = None, 0.0

    def look(self, state: State) -> None:
        """Latch what a reading says is wrong."""
        limits = self.limits
        if state.hardware_error:
            self.trip(Fault("hardware_error", detail=state.hardware_error))
        if state.ft_trouble:
            self.trip(Fault("ft", detail=state.ft_trouble))
        for cause, value, limit, unit in (
            ("deflection", abs(state.position), limits.deflection, "rad"),
            ("temperature", state.temperature, limits.temperature, "°C"),
            ("current", abs(state.current), limits.current, "A"),
        ):
            if value > limit:
                self.trip(Fault(cause, value, limit, unit))
        if state.voltage < limits.voltage:
            self.trip(Fault("voltage", state.voltage, limits.voltage, "V", "too low"))

    def allowed(self, wanted: float, age: float | None) -> float:
        """Return the torque to write now (N m). age: of the command, s; None when there is none."""
        limits = self.limits
        if self.fault is None and age is not None and age > limits.command_timeout and self.torque != 0.0:
            self.trip(Fault(COMMAND_TIMEOUT, 1e3 * age, 1e3 * limits.command_timeout, "ms"))
        if self.fault is None:
            self.torque = self._within(0.0 if age is None else wanted)
        elif self.fault.cause == COMMAND_TIMEOUT:
            self.torque = math.copysign(max(0.0, abs(self.torque) - self._ramp), self.torque)
        else:
            self.torque = 0.0
        return self.torque

    def _within(self, wanted: float) -> float:
        step = self.limits.slew * self._period
        torque = min(max(wanted, -self.limits.torque), self.limits.torque)
        torque = min(max(torque, self.torque - step), self.torque + step)
        self.limited += torque != wanted
        return torque


def check_limits(limits: Limits, motor_limit: float, stiffness: float) -> None:
    """Compare limits with the motor's own torque limit (N m) and the spring of the rig (N m/rad).

    The torque limit at rest deflects the spring by torque / stiffness. Raises ParameterError.
    """
    if limits.torque > motor_limit * (1.0 + 1e-9):
        raise ParameterError(
            f"parameter torque_limit = {limits.torque:g} N m, expected at most {motor_limit:.4g} N m,"
            " the motor's own limit"
        )
    if limits.torque / stiffness > limits.deflection:
        raise ParameterError(
            f"parameter torque_limit = {limits.torque:g} N m deflects the rig's spring"
            f" of {stiffness:.4g} N m/rad by {limits.torque / stiffness:.4g} rad,"
            f" expected at most deflection_limit = {limits.deflection:.4g} rad"
        )
