"""Device: the interface of an actuator, real or simulated, to a driver."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.protection import Protection
from rsea_ros.records.record import is_measured

Wrench = tuple[float, float, float, float, float, float]


class NoReply(DeviceError):
    """A transaction without an intact reply in its time; the next one may do."""


class Refused(DeviceError):
    """An instruction that the device understood and did not obey."""


class PortLost(DeviceError):
    """The port does not exist, or has vanished."""


@dataclass(frozen=True)
class State:
    """One reading.

    stamp, ft_stamp: instants of acquisition, ns since the epoch, on a clock that goes on evenly from `open`
    on when the system clock is set. position: rad, velocity: rad/s, of the gear
    output relative to the housing. motor_torque: N m at the gear output, from measured current. wrench:
    force x, y, z (N) and torque x, y, z (N m) of the F/T sensor; None without one.
    wrenches: all since the last reading, as (stamp, wrench), where the sensor is faster.
    current A, voltage V, temperature °C: nan where the device does not measure them: no limit then.
    hardware_error, ft_trouble: errors reported by motor and sensor, in words; empty without any.
    motor_trouble: settings that the motor has lost, such as torque off, in words.
    deflection: rad, of the spring, from a second encoder, the drive's side less the distal one; nan without.
    inferred: whether the wrench is stiffness times deflection, not measured.
    acknowledged_late: whether the reply to a write that raised NoReply arrived during this reading.
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
    acknowledged_late: bool = False


@dataclass(frozen=True)
class Spring:
    """The spring as a torque sensor: two encoders, one on each side of it, in place of an F/T sensor.

    stiffness: of the rig, N m/rad. place: of the actuator's axis in the wrench; sign: of it, +1 or -1.

    It gives the torque of the elastic element alone, K d: a sensor in series also measures the spring's
    damper, K d + b d'. It is as accurate as the stiffness, and zero at zero deflection.
    """

    stiffness: float
    place: int = 5
    sign: float = 1.0

    def __str__(self) -> str:
        return f"stiffness of {self.stiffness:.4g} N·m/rad times measured deflection"

    def with_wrench(self, state: State) -> State:
        """Return a reading with the wrench of its deflection, unless it has a wrench or no deflection."""
        if state.wrench is not None or not is_measured(state.deflection):
            return state
        values = [0.0] * 6
        values[self.place] = self.sign * self.stiffness * state.deflection
        wrench: Wrench = (values[0], values[1], values[2], values[3], values[4], values[5])
        return replace(
            state, ft_stamp=state.stamp, wrench=wrench, wrenches=((state.stamp, wrench),), inferred=True
        )


class Device(Protocol):
    """An actuator on a wire. Each method raises DeviceError when the device does not answer.

    A DeviceError is a fault of the device: the driver latches it, NoReply only after `lost_cycles` of them.
    Any other exception is a mistake of the program: the driver closes the device and is unconfigured.
    `read` and `write` are called in every cycle, by one thread: together they may block for the rest of a
    period, and a reply that is not received by then is a NoReply. All others may take seconds; no cycle runs
    meanwhile, but beside `zero_ft` and `health`, which must not touch what `read` and `write` use.
    protection: against a dead driver process; read once the device is open.
    """

    @property
    def protection(self) -> Protection:
        """Return the protection against a dead host, of the kind NONE where there is none."""

    def open(self) -> None:
        """Connect, with no torque."""

    def enable(self) -> None:
        """Switch the torque on, at zero. Raises DeviceError for another actuator than the opened one, too."""

    def read(self) -> State:
        """Return the newest reading."""

    def write(self, torque: float) -> None:
        """Command a motor torque at the gear output (N m), held until the next one."""

    def disable(self) -> None:
        """Command zero torque and switch it off."""

    def zero_ft(self) -> None:
        """Set the zero of the F/T sensor at its present reading."""

    def recover(self) -> None:
        """Reconnect a lost connection. Raises DeviceError while a fault is still present."""

    def reboot(self) -> None:
        """Restart the actuator, with no torque."""

    def health(self) -> Mapping[str, object]:
        """Return counts and values for diagnostics, by name."""

    def close(self) -> None:
        """Command zero torque and release the device.

        May follow anything: a failed `open`, any exception, itself.
        It raises nothing for an absent device: the protection ends its torque.
        """
