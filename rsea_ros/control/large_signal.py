"""Up to where a torque can be tracked at all: what the motor has to make and how fast it has to turn for it.

|T_m| = A / |P|,   |w| = A |P_w / P|          P = T_d / T_m, P_w = w / T_m, continuous, at A sin(2 pi f t)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.response import frequency_response
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

HIGHEST = 400.0
LOWEST = 0.5
POINTS = 4000


@dataclass(frozen=True)
class Reach:
    """amplitude: N m. hz: where it can no longer be tracked (inf: nowhere). by: torque or speed."""

    amplitude: float
    hz: float
    by: str


def motor_demand(rig: Rig, hz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return motor torque (N m) and speed of the gear output (rad/s) per N m of distal torque, shape (n,)."""
    torque = np.abs(frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz))
    angle = np.abs(frequency_response(rig, outputs.position(), hz))
    return 1.0 / torque, 2.0 * np.pi * hz * angle / torque


def reach(rig: Rig, amplitude: float, torque: float, speed: float) -> Reach:
    """Return the lowest frequency from which on an amplitude (N m) takes more than the motor has.

    torque: N m, speed: rad/s at the gear output; inf where not stated. What is above the limit only in a
    narrow band below (a pendulum that swings) counts as well.
    """
    hz = np.geomspace(LOWEST, HIGHEST, POINTS)
    per_torque, per_speed = motor_demand(rig, hz)
    short = {"torque": amplitude * per_torque > torque, "speed": amplitude * per_speed > speed}
    first = {by: float(hz[np.argmax(over)]) for by, over in short.items() if over.any()}
    if not first:
        return Reach(amplitude, float("inf"), "")
    by = min(first, key=lambda name: first[name])
    return Reach(amplitude, first[by], by)


def largest(rig: Rig, hz: float, torque: float, speed: float) -> float:
    """Return the largest amplitude, N m, that can be tracked at a frequency, Hz."""
    per_torque, per_speed = motor_demand(rig, np.array([hz]))
    return float(min(torque / per_torque[0], speed / per_speed[0]))
