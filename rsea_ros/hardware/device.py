"""Device: what a driver can do with an actuator, real or simulated."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.protection import Protection

Wrench = tuple[float, float, float, float, float, float]


class NoReply(DeviceError):
    """A transaction without an intact reply in its time; the next one may do."""


class Refused(DeviceError):
    """An instruction that the device understood and did not obey."""


class PortLost(DeviceError):
    """The port is not there, or not any more."""


@dataclass(frozen=True)
class State:
    """One reading.

    stamp, ft_stamp: instants of acquisition, ns since the epoch, on a clock that goes on evenly from `open`
    on when the system clock is set. position: rad, velocity: rad/s, of the gear
    output relative to the housing. motor_torque: N m at the gear output, from measured current. wrench:
    force x, y, z (N) and torque x, y, z (N m) of the F/T sensor; None without one.
    wrenches: all that came since the last reading, as (stamp, wrench), where the sensor is faster.
    current A, voltage V, temperature °C: nan where the device does not measure them.
    hardware_error, ft_trouble: what motor and sensor complain of, in words; empty when of nothing.
    motor_trouble: what the motor has become that it was not made to be, such as torque off, in words.
    deflection: rad, of the spring, from a second encoder, the drive's side less the distal one; nan without.
    inferred: whether the wrench is stiffness times deflection, and no sensor's.
    """

    stamp: int
    position: float
    velocity: float
    motor_torque: float
    ft_stamp: int = 0
    wrench: Wrench | None = None
    wrenches: Sequence[tuple[int, Wrench]] = ()
    current: float = math.nan
    voltage: float = math.nan
    temperature: float = math.nan
    hardware_error: str = ""
    ft_trouble: str = ""
    motor_trouble: str = ""
    deflection: float = math.nan
    inferred: bool = False


class Device(Protocol):
    """An actuator on a wire. Each method raises DeviceError when the device does not answer.

    A DeviceError is a fault of the device: the driver latches it, NoReply only after `lost_cycles` of them.
    Any other exception is a mistake of the program: the driver closes the device and is unconfigured.
    `read` and `write` are called in every cycle, by one thread: together they may block for the rest of a
    period, and a reply that does not come by then is a NoReply. All others may take seconds; no cycle runs
    meanwhile, but beside `zero_ft` and `health`, which must not touch what `read` and `write` use.
    protection: what ends the torque when the driver's process dies; asked once the device is open.
    """

    @property
    def protection(self) -> Protection:
        """Return the protection against a dead host, of the kind NONE where there is none."""

    def open(self) -> None:
        """Connect, with no torque."""

    def enable(self) -> None:
        """Switch the torque on, at zero."""

    def read(self) -> State:
        """Return the newest reading."""

    def write(self, torque: float) -> None:
        """Command a motor torque at the gear output (N m), held until the next one."""

    def disable(self) -> None:
        """Command zero torque and switch it off."""

    def zero_ft(self) -> None:
        """Take what the F/T sensor measures now for zero."""

    def recover(self) -> None:
        """Connect again where the connection was lost. Raises DeviceError while a fault is still there."""

    def reboot(self) -> None:
        """Restart the actuator, with no torque."""

    def health(self) -> Mapping[str, object]:
        """Return counts and values for diagnostics, by name."""

    def close(self) -> None:
        """Command zero torque and let go. It follows on everything: a failed `open`, any exception, itself.

        It raises nothing for a device that is away: that its torque ends then is the protection's work.
        """
