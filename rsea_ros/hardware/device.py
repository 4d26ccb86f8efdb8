"""Device: what a driver can do with an actuator, real or simulated. Four methods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

Wrench = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class State:
    """One reading.

    stamp, ft_stamp: instants of acquisition, ns since the epoch. position: rad, velocity: rad/s, of the gear
    output relative to the housing. motor_torque: N m at the gear output, from measured current. wrench:
    force x, y, z (N) and torque x, y, z (N m) of the F/T sensor; None without one.
    """

    stamp: int
    position: float
    velocity: float
    motor_torque: float
    ft_stamp: int = 0
    wrench: Wrench | None = None


class Device(Protocol):
    """An actuator on a wire. Each method raises DeviceError when the device does not answer."""

    def open(self) -> None:
        """Connect, with no torque."""

    def read(self) -> State:
        """Return the newest reading."""

    def write(self, torque: float) -> None:
        """Command a motor torque at the gear output (N m), held until the next one."""

    def close(self) -> None:
        """Command zero torque and let go; also after a failed `open` or `read`."""
