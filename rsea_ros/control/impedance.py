"""Output impedance: the torque that a motion of the distal side makes, which a torque source should not feel.

    T = P u + H_T w_d,   w = P_w u + H_w w_d,   u = -(a T + b w) / N
    T / w_d = H_T - P (a H_T + b H_w) / D

w_d is the speed of the distal side, w that of the gear, a and b the law's actions, N and D as in loop.py. H
is the bench without motor torque. A motor at rest leaves the spring: Z_s = K_s / s + b_s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.control.law import FT, FeedbackLaw, Gains, law_of, responses, sample_rig, z_of
from rsea_ros.control.margins import actions, returns
from rsea_ros.control.uncertainty import BenchVariant, Uncertainty, lags_of, lock, mode_of, variant_rig
from rsea_ros.model import outputs
from rsea_ros.model.equations import COORDINATES, D
from rsea_ros.model.outputs import Output
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import ComplexArray, FloatArray


@dataclass(frozen=True)
class OutputImpedance:
    """N m s/rad at hz, shape (n,): under control, with the motor off, with the motor at rest."""

    hz: FloatArray
    controlled: ComplexArray
    motor_off: ComplexArray
    spring: ComplexArray


@dataclass(frozen=True)
class Moved:
    """The locked rig's answer to the motor, shape (4, n), and without it to a moved distal side: torque and
    speed of the gear, per rad/s; the spring's impedance; all at hz. sensor: what the F/T sensor makes of the
    torque; path, current: as `returns` has them."""

    hz: FloatArray
    plant: ComplexArray
    torque: ComplexArray
    speed: ComplexArray
    spring: ComplexArray
    sensor: ComplexArray | float = 1.0
    path: ComplexArray | float = 1.0
    current: ComplexArray | float = 1.0

    def impedance(self, law: FeedbackLaw, on_link: ComplexArray | float = 0.0) -> ComplexArray:
        """Return T / w_d under a law, N m s/rad, shape (n,). on_link: of `linked`, N m/rad."""
        on_ft, on_velocity, _ = actions(law, self.hz)
        sensed = self.plant.copy()
        sensed[FT] *= self.sensor
        _, whole = returns(law, sensed, self.hz, self.path, self.current)
        commanded = (on_ft * self.sensor * self.torque + on_velocity * self.speed) / z_of(law.period, self.hz)
        commanded = commanded - on_link / (2j * np.pi * self.hz)
        opposed: ComplexArray = self.torque - self.plant[FT] * self.path * commanded / whole
        return opposed

    def ratio(self, law: FeedbackLaw, on_link: ComplexArray | float = 0.0) -> FloatArray:
        """Return |T / w_d| over that of the bare spring. on_link: as `impedance` has it."""
        return np.abs(self.impedance(law, on_link) / self.spring)


def distal_responses(rig: Rig, rate: float, hz: FloatArray) -> Moved:
    """Return the responses to a moved distal side of a rig, its housing clamped. hz: below half the rate."""
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    torque, speed = _without_motor(rig, hz, s)
    spring = -(rig["spring.stiffness"] / s + rig["spring.damping"])
    return Moved(hz, responses(sample_rig(lock(rig), rate), hz), torque, speed, spring)


def moved_bench(rig: Rig, rate: float, hz: FloatArray, case: BenchVariant, u: Uncertainty) -> Moved:
    """Return what moving the distal side of a bench of the set does. hz: below half the rate."""
    path, current = lags_of(case, rate, hz)
    still = distal_responses(variant_rig(rig, case), rate, hz)
    return replace(still, sensor=mode_of(u.mode, case.participation, hz), path=path, current=current)


def impedance(rig: Rig, rate: float, gains: Gains, hz: FloatArray) -> OutputImpedance:
    """Return the impedance of the distal side against a clamped housing. hz: below half the rate."""
    moved = distal_responses(rig, rate, hz)
    return OutputImpedance(hz, moved.impedance(law_of(rig, rate, gains)), moved.torque, moved.spring)


def _without_motor(rig: Rig, hz: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return torque at the sensor and speed of the gear over the speed of the distal side, no motor torque.

    Any inertia may be on the distal side: the torque that moves it cancels.
    """
    free = replace(rig.with_values({"spring_end.inertia": 1.0}), clamped=frozenset({"housing_end"}))
    distal = Output(np.zeros((3, COORDINATES)), np.zeros_like(outputs.position().d))
    distal.c[0, D] = 1.0
    measured = (outputs.end_torque(free, "spring_end"), outputs.position(), distal)
    torque, angle, turned = (frequency_response(free, output, hz, "distal") for output in measured)
    return torque / (s * turned), angle / turned
