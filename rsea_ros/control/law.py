"""The feedback law, linear, one sample at a time: PD on the torque error and a disturbance observer.

    u = k_p e + k_d e' + Q d,     d = u_applied - (J_m w' + b_m w + T_ft)

e is the torque error. e' comes from the spring rate: a sensor sees T = K_s phi + b_s phi', so phi' is T
through s / (K_s + b_s s), and K_s phi' is what is fed back; a differentiator with the pole that the spring
itself has. d is the torque on the gear that the rig does not explain (friction for the most part), mean
over the sample that has just ended. J_m, b_m, w belong to the motor, and T_ft is the load that it feels:
the load's own mechanics are not in it, so the observer is the same for a clamped and for a free bench. Q is
a first-order low pass by Tustin's rule, with its zero at half the sampling rate. Disturbance observer:
Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1, 1996.

A command that is computed at sample k acts from k+1 to k+2: one sample of delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from rsea_ros.model.rig import Rig


@dataclass(frozen=True)
class Gains:
    """k_p: 1. k_d: s, so that k_d K_s is a damping in N m s/rad. q_frequency: of Q, Hz."""

    k_p: float
    k_d: float
    q_frequency: float


@dataclass(frozen=True)
class Law:
    """Coefficients of the difference equations. rate: of the spring's rate; q: of Q."""

    gains: Gains
    inertia: float
    damping: float
    period: float
    rate_pole: float
    q_pole: float
    q_gain: float


class State(NamedTuple):
    """What the law remembers: the last error, spring rate, ft, velocity, d, Q d; the last two torques."""

    error: float = 0.0
    rate: float = 0.0
    ft: float = 0.0
    velocity: float = 0.0
    unexplained: float = 0.0
    disturbance: float = 0.0
    newest: float = 0.0
    applied: float = 0.0


def law_of(rig: Rig, rate: float, gains: Gains) -> Law:
    """Return the law of a rig's actuator at `rate`, Hz."""
    period, b_s = 1.0 / rate, rig["spring.damping"]
    warped = math.tan(math.pi * min(gains.q_frequency * period, 0.49))
    return Law(
        gains,
        rig["rotor.reflected_inertia"],
        rig["rotor.reflected_damping"],
        period,
        rate_pole=math.exp(-period * rig["spring.stiffness"] / b_s) if b_s > 0.0 else 0.0,
        q_pole=(1.0 - warped) / (1.0 + warped),
        q_gain=warped / (1.0 + warped),
    )


def feedback(law: Law, s: State, error: float, ft: float, velocity: float) -> tuple[float, State]:
    """Return the torque, N m, that a sample asks for, and the new state; `hold` has to follow.

    error: N m. ft: N m. velocity: rad/s, of the gear output against the housing.
    """
    h = law.period
    rate = law.rate_pole * s.rate + (1.0 - law.rate_pole) * (error - s.error) / h
    explained = (
        law.inertia * (velocity - s.velocity) / h
        + 0.5 * law.damping * (velocity + s.velocity)
        + 0.5 * (ft + s.ft)
    )
    unexplained = s.applied - explained
    disturbance = law.q_pole * s.disturbance + law.q_gain * (unexplained + s.unexplained)
    torque = law.gains.k_p * error + law.gains.k_d * rate + disturbance
    return torque, State(error, rate, ft, velocity, unexplained, disturbance, s.newest, s.applied)


def hold(s: State, torque: float) -> State:
    """Return the state with the torque from the next sample on, as far as the rig explains what it does."""
    return s._replace(newest=torque, applied=s.newest)
