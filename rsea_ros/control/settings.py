"""Limits and options of a torque controller, without its gains."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.model.rig import MOTOR_TORQUE, Rig, motor_torque

CORNER = 80.0
"""Hz: what a desired torque does faster is not predicted. At 280 Hz 5 Hz are predicted within 0.9 %."""


@dataclass(frozen=True)
class TorqueLimits:
    """torque: N m, of the motor. slew: N m/s. ramp: s in which the limit grows after the start."""

    torque: float = MOTOR_TORQUE
    slew: float = 40_000.0
    ramp: float = 0.25

    @classmethod
    def of(cls, rig: Rig) -> TorqueLimits:
        """Return the limits of the motor that the rig states, else those of MOTOR_TORQUE."""
        return cls(motor_torque(rig)[0])


@dataclass(frozen=True)
class ControllerSettings:
    """How a controller uses its rig and the desired torque.

    compensate: effects of the rig to compensate; None: all that have a law for it. preview: the desired
    torque is known two samples ahead, so it is not predicted. corner: of the prediction, Hz. learn: learn
    load and drive; use False inside an outer loop whose desired torque follows the motion (virtual.py),
    because learning would change its impedance.
    """

    compensate: tuple[str, ...] | None = None
    preview: bool = False
    corner: float = CORNER
    learn: bool = True
