"""The control law, and the sampled plant that it is made for.

u = k_p e + k_d e' + k_i I e + k_w H (w_r - w) + Q d,       d = u_applied - (J_m w' + b_m w + T_ft)
    I = (1 + w_i / s) / (1 + s / w_l)

e is the torque error. e' comes from the spring rate: a sensor sees T = K_s phi + b_s phi', so phi' is T
through s / (K_s + b_s s), and K_s phi' is fed back; a differentiator with the pole that the spring
itself has. I is a gain below LEAK, and integrates below REST: with a load that turns freely the gear has to
travel for a torque, and an integral alone would swing with it. w_r - w is how much slower the gear turns than
the model; H, a high pass at WASH, damps its swing without holding back what the load does slowly, and no mode
of the F/T sensor's mount is in it. d is the torque on the gear that the rig does not explain (friction for
the most part), mean over the sample that has just ended. J_m, b_m, w belong to the motor, and T_ft is the
load that it feels: the load's own mechanics are not in it, so the observer is the same for a clamped and for
a free bench. Q is a first-order low pass by Tustin's rule, with its zero at half the sampling rate.
Disturbance observer: Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1, 1996.

A command that is computed at sample k acts from k+1 to k+2: one sample of delay.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from rsea_ros.errors import ParameterError
from rsea_ros.model import outputs, propagator
from rsea_ros.model.equations import PORTS
from rsea_ros.model.outputs import Output
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import read
from rsea_ros.records.record import ComplexArray, FloatArray

WASH = 2.0
"""Hz, corner of H: at 1 Hz it softens the output by a fifth against 1 Hz, for the same largest impedance."""

LEAK, REST = 1.0, 0.03
"""Hz, of w_l and w_i. At 0.1 Hz for w_i a free load swings back by half of what an error has moved it."""

MOST = 0.2
"""N m of e / (1 + s / w_l) that is integrated: what is larger passes by itself, and would leave a tail."""


@dataclass(frozen=True)
class Gains:
    """k_p, k_i: 1. k_d: s, so that k_d K_s is a damping in N m s/rad. q_frequency: of Q, Hz.
    k_w: N m s/rad.
    """

    k_p: float
    k_d: float
    k_i: float
    q_frequency: float
    k_w: float


@dataclass(frozen=True)
class FeedbackLaw:
    """Coefficients of the difference equations. rate: of the spring's rate; q: of Q; wash: of H; leak, rest:
    of I."""

    gains: Gains
    inertia: float
    damping: float
    period: float
    rate_pole: float
    q_pole: float
    q_gain: float
    wash_pole: float
    leak_pole: float
    leak_gain: float
    rest_gain: float


class FeedbackState(NamedTuple):
    """The memory of the law: the last error, spring rate, e / (1 + s / w_l) and its integral, ft, velocity,
    w_r - w, H of that, d, Q d; the last two torques."""

    error: float = 0.0
    rate: float = 0.0
    slow: float = 0.0
    integral: float = 0.0
    ft: float = 0.0
    velocity: float = 0.0
    slowness: float = 0.0
    swing: float = 0.0
    unexplained: float = 0.0
    disturbance: float = 0.0
    newest: float = 0.0
    applied: float = 0.0


def law_of(rig: Rig, rate: float, gains: Gains) -> FeedbackLaw:
    """Return the law of a rig's actuator at `rate`, Hz."""
    period, b_s = 1.0 / rate, rig["spring.damping"]
    warped = math.tan(math.pi * min(gains.q_frequency * period, 0.49))
    return FeedbackLaw(
        gains,
        rig["rotor.reflected_inertia"],
        rig["rotor.reflected_damping"],
        period,
        rate_pole=math.exp(-period * rig["spring.stiffness"] / b_s) if b_s > 0.0 else 0.0,
        q_pole=(1.0 - warped) / (1.0 + warped),
        q_gain=warped / (1.0 + warped),
        wash_pole=math.exp(-2.0 * math.pi * WASH * period),
        leak_pole=math.exp(-2.0 * math.pi * LEAK * period),
        leak_gain=0.5 * (1.0 - math.exp(-2.0 * math.pi * LEAK * period)),
        rest_gain=math.pi * REST * period,
    )


def feedback(
    law: FeedbackLaw, s: FeedbackState, error: float, slowness: float, ft: float, velocity: float
) -> tuple[float, FeedbackState]:
    """Return the torque, N m, for a sample, and the new state; `hold` has to follow.

    error: N m. slowness: w_r - w, rad/s. ft: N m. velocity: w, rad/s, of the gear output against the housing.
    """
    h, g = law.period, law.gains
    rate = law.rate_pole * s.rate + (1.0 - law.rate_pole) * (error - s.error) / h
    slow = law.leak_pole * s.slow + law.leak_gain * (error + s.error)
    integral = s.integral + law.rest_gain * min(max(slow + s.slow, -2.0 * MOST), 2.0 * MOST)
    swing = law.wash_pole * s.swing + 0.5 * (1.0 + law.wash_pole) * (slowness - s.slowness)
    explained = (
        law.inertia * (velocity - s.velocity) / h
        + 0.5 * law.damping * (velocity + s.velocity)
        + 0.5 * (ft + s.ft)
    )
    unexplained = s.applied - explained
    disturbance = law.q_pole * s.disturbance + law.q_gain * (unexplained + s.unexplained)
    torque = g.k_p * error + g.k_d * rate + g.k_i * (slow + integral) + g.k_w * swing + disturbance
    after = FeedbackState(error, rate, slow, integral, ft, velocity, slowness, swing, unexplained,
                          disturbance, s.newest, s.applied)  # fmt: skip
    return torque, after


def hold(s: FeedbackState, torque: float) -> FeedbackState:
    """Return the state with the torque from the next sample on, for the disturbance observer."""
    return s._replace(newest=torque, applied=s.newest)


FT, VELOCITY, POSITION, LINK = range(4)


@dataclass(frozen=True)
class Sampled:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k]: y is ft (N m), velocity (rad/s) and position (rad) of the
    gear, and position (rad) of the link, all against the housing.

    a: shape (n, n). b: shape (n,). c: shape (4, n). period: s.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    period: float


def sample_rig(rig: Rig, rate: float) -> Sampled:
    """Return a rig behind a zero-order hold at `rate`, Hz. Its effects are left out.

    Raises ParameterError for a rig whose torque a controller cannot feel.
    """
    check_controllable(rig)
    position = outputs.position()
    velocity = Output(np.roll(position.c, 1, axis=0), position.d)
    wanted = (outputs.end_torque(rig, rig.ft_end), velocity, position, outputs.link())
    system = propagator.state_space(rig)
    n = len(system.a)
    generator = np.zeros((n + 1, n + 1))
    generator[:n] = np.column_stack([system.a, system.b[:, PORTS.index("gear")]])
    held = expm(generator / rate)
    return Sampled(held[:n, :n], held[:n, n], np.vstack([read(system, o)[0] for o in wanted]), 1.0 / rate)


def check_controllable(rig: Rig) -> None:
    """Raise ParameterError for a rig without a spring, or whose F/T sensor is not at the spring's end."""
    if rig.rigid_spring:
        raise ParameterError(
            f"rig {rig.name}: spring.rigid = True, expected a spring whose torque is controlled"
        )
    if rig.ft_end != "spring_end":
        raise ParameterError(f"rig {rig.name}: ft_end = {rig.ft_end}, expected spring_end for torque control")


def responses(plant: Sampled, hz: FloatArray) -> ComplexArray:
    """Return the outputs of `Sampled` per N m at frequencies, Hz, below half the rate: shape (4, n)."""
    z = z_of(plant.period, hz)[:, None, None]
    x = np.linalg.solve(z * np.eye(len(plant.a)) - plant.a, plant.b[:, None].astype(complex))[..., 0]
    response: ComplexArray = plant.c @ x.T
    return response


def z_of(period: float, hz: FloatArray) -> ComplexArray:
    """Return exp(2 pi i f T)."""
    z: ComplexArray = np.exp(2j * np.pi * period * np.asarray(hz, dtype=np.float64))
    return z
