"""The spring as a torque sensor: two encoders, one on each side of it, in place of an F/T sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rsea_ros.hardware.device import State, Wrench
from rsea_ros.records.record import is_measured


@dataclass(frozen=True)
class Spring:
    """stiffness: of the rig, N m/rad. place: of the actuator's axis in the wrench; sign: of it, +1 or -1.

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
