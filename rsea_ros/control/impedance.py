"""Output impedance: the torque that a motion of the distal side makes, which a torque source should not feel.

    T = P u + H_T w_d,   w = P_w u + H_w w_d,   u = -(a T + b w)
    T / w_d = H_T - P (a H_T + b H_w) / (1 + L)

w_d is the speed of the distal side, w that of the gear, a and b the law's actions (loop.py). H is the bench
without motor torque. A motor that stands still leaves the spring: K_s / s + b_s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.loads import locked
from rsea_ros.control.loop import actions
from rsea_ros.control.sampled import FT, VELOCITY, responses, sampled
from rsea_ros.model import outputs
from rsea_ros.model.equations import COORDINATES, D
from rsea_ros.model.outputs import Output
from rsea_ros.model.response import frequency_response
from rsea_ros.model.rig import Rig
from rsea_ros.signals import ComplexArray, FloatArray


@dataclass(frozen=True)
class Impedance:
    """N m s/rad at hz, shape (n,): under control, with the motor off, with the motor standing still."""

    hz: FloatArray
    controlled: ComplexArray
    motor_off: ComplexArray
    spring: ComplexArray


def impedance(rig: Rig, rate: float, gains: Gains, hz: FloatArray) -> Impedance:
    """Return the impedance of the distal side against a clamped housing. hz: below half the rate."""
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    plant = responses(sampled(locked(rig), rate), hz)
    torque, speed = _without_motor(rig, hz, s)
    on_ft, on_velocity = actions(law_of(rig, rate, gains), hz)
    loop = on_ft * plant[FT] + on_velocity * plant[VELOCITY]
    controlled = torque - plant[FT] * (on_ft * torque + on_velocity * speed) / (1.0 + loop)
    return Impedance(hz, controlled, torque, -(rig["spring.stiffness"] / s + rig["spring.damping"]))


def _without_motor(rig: Rig, hz: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return torque at the sensor and speed of the gear over the speed of the distal side, no motor torque.

    Any inertia may be moved there: what moves it cancels.
    """
    moved = replace(rig.with_values({"spring_end.inertia": 1.0}), clamped=frozenset({"housing_end"}))
    distal = Output(np.zeros((3, COORDINATES)), np.zeros_like(outputs.position().d))
    distal.c[0, D] = 1.0
    asked = (outputs.end_torque(moved, "spring_end"), outputs.position(), distal)
    torque, angle, turned = (frequency_response(moved, output, hz, "distal") for output in asked)
    return torque / (s * turned), angle / turned
