"""An outer impedance loop: the output feels like a spring and a damper, by the torque that is asked for.

    desired = -(K_v theta + D_v theta'),   theta = position - ft / K_s: where the distal side is

and what that is from outside, w the speed of the distal side:

    Z = Z_0 + G (K_v / s + D_v),   Z_0 = -T / w of the torque controller alone,   G = T / desired

A load that is passive cannot make the whole unstable as long as Re Z > 0 (Colgate, Hogan, Int. J. Control 48,
1988). In continuous time a series elastic actuator shows at most its own spring (Vallery et al., IEEE/RSJ
IROS 2007; Tagliamonte, Accoto, IEEE/ASME AIM 2014); sampled, with two samples to the end of a hold, every
K_v > 0 leaves passivity somewhere, and the question is from which frequency on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.controller import Measurement
from rsea_ros.control.impedance import distal_responses
from rsea_ros.control.law import law_of
from rsea_ros.control.prediction import prediction_response, smoothed_response
from rsea_ros.control.settings import CORNER
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray

SMALLEST = 0.02
"""Hz, from which on passivity is looked at."""


@dataclass(frozen=True)
class Virtual:
    """K_v, N m/rad; D_v, N m s/rad."""

    stiffness: float
    damping: float

    def torque(self, reading: Measurement, velocity: float, k_s: float) -> float:
        """Return the desired torque, N m. velocity: of the distal side, rad/s."""
        return -self.stiffness * (reading.position - reading.ft / k_s) - self.damping * velocity


def felt_impedance(
    rig: Rig, design: ControllerDesign, virtual: Virtual, hz: FloatArray, *, trust: bool = True
) -> ComplexArray:
    """Return Z, N m s/rad, of the locked rig moved at its distal side, linear, at hz below half the rate.

    trust: whether the desired torque is predicted; else it comes through the low pass, two samples late.
    """
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    alone = -distal_responses(rig, design.rate, hz).impedance(law_of(rig, design.rate, design.gains))
    h = 1.0 / design.rate
    follows = prediction_response(CORNER, h, hz) if trust else smoothed_response(h, hz)
    whole: ComplexArray = alone + follows * (virtual.stiffness / s + virtual.damping)
    return whole


def passive_to(rig: Rig, design: ControllerDesign, virtual: Virtual) -> float:
    """Return the frequency from which on Re Z < 0, Hz, with the desired torque predicted or not, whichever is
    lower; inf where it never is, to 0.45 of the rate."""
    hz = np.geomspace(SMALLEST, 0.45 * design.rate, 400)
    real = [felt_impedance(rig, design, virtual, hz, trust=trust).real for trust in (True, False)]
    negative = np.min(real, axis=0) < 0.0
    return float(hz[np.argmax(negative)]) if negative.any() else math.inf


def stiffest(rig: Rig, design: ControllerDesign, damping: float, to: float) -> float:
    """Return the largest K_v, N m/rad, that keeps Re Z > 0 up to a frequency, Hz."""
    low, high = 0.0, 4.0 * rig["spring.stiffness"]
    for _ in range(30):
        middle = 0.5 * (low + high)
        kept = passive_to(rig, design, Virtual(middle, damping)) >= to
        low, high = (middle, high) if kept else (low, middle)
    return low
