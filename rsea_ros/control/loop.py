"""The loop: open at the motor torque, as a frequency response; closed, as poles of the code that runs."""

from __future__ import annotations

import numpy as np

from rsea_ros.control.law import Law, State, feedback, hold
from rsea_ros.control.sampled import FT, VELOCITY, Sampled, z_of
from rsea_ros.signals import ComplexArray, FloatArray


def actions(law: Law, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return what the law makes of ft (1) and of the velocity (N m s/rad), its own memory and delay included.

    (C / z, Q (J (1 - 1/z)/T + b (1 + 1/z)/2) / z), over 1 - Q / z^2, with C = k_p + k_d D + Q (1 + 1/z)/2.
    """
    back = 1.0 / z_of(law.period, hz)
    rate = (1.0 - law.rate_pole) / law.period * (1.0 - back) / (1.0 - law.rate_pole * back)
    q = law.q_gain * (1.0 + back) / (1.0 - law.q_pole * back)
    on_ft = law.gains.k_p + law.gains.k_d * rate + 0.5 * q * (1.0 + back)
    on_velocity = q * (law.inertia * (1.0 - back) / law.period + 0.5 * law.damping * (1.0 + back))
    memory = back / (1.0 - q * back**2)
    return on_ft * memory, on_velocity * memory


def open_loop(law: Law, plant: ComplexArray, hz: FloatArray) -> ComplexArray:
    """Return L, the loop broken at the motor torque behind its current, shape (n,). plant: of `responses`."""
    on_ft, on_velocity = actions(law, hz)
    loop: ComplexArray = on_ft * plant[FT] + on_velocity * plant[VELOCITY]
    return loop


def closed_loop_matrix(law: Law, plant: Sampled, share: float = 1.0) -> FloatArray:
    """Return the matrix that takes bench and law from one sample to the next, without a desired torque.

    Its columns are the answers of `feedback` and `hold` to unit states. share: of the torque that acts.
    """
    n, size = len(plant.a), len(plant.a) + len(State._fields)
    columns = [_step(law, plant, unit[:n], State(*unit[n:]), share) for unit in np.eye(size)]
    return np.column_stack(columns)


def largest_pole(law: Law, plant: Sampled, share: float = 1.0) -> float:
    """Return the largest modulus of a closed-loop pole: stable below 1."""
    return float(np.abs(np.linalg.eigvals(closed_loop_matrix(law, plant, share))).max())


def _step(law: Law, plant: Sampled, x: FloatArray, s: State, share: float) -> FloatArray:
    y = plant.c @ x
    torque, after = feedback(law, s, -float(y[FT]), float(y[FT]), float(y[VELOCITY]))
    return np.concatenate([plant.a @ x + plant.b * s.newest, hold(after, share * torque)])
