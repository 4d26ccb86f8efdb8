"""The loop: open at the motor torque, as a frequency response; closed, as poles of the code that runs."""

from __future__ import annotations

import numpy as np

from rsea_ros.control.law import FeedbackLaw, FeedbackState, feedback, hold
from rsea_ros.control.sampled import FT, VELOCITY, Sampled, z_of
from rsea_ros.records.record import ComplexArray, FloatArray


def actions(law: FeedbackLaw, hz: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return the law's responses to ft (1), velocity (N m s/rad) and applied torque (1).

    C + Q (1 + 1/z)/2,   k_w H + Q (J (1 - 1/z)/T + b (1 + 1/z)/2),   Q / z,   C = k_p + k_d D + k_i I
    """
    g, back = law.gains, 1.0 / z_of(law.period, hz)
    rate = (1.0 - law.rate_pole) / law.period * (1.0 - back) / (1.0 - law.rate_pole * back)
    slow = law.leak_gain * (1.0 + back) / (1.0 - law.leak_pole * back)
    slow = slow * (1.0 + law.rest_gain * (1.0 + back) / (1.0 - back))
    wash = 0.5 * (1.0 + law.wash_pole) * (1.0 - back) / (1.0 - law.wash_pole * back)
    q = law.q_gain * (1.0 + back) / (1.0 - law.q_pole * back)
    on_ft = g.k_p + g.k_d * rate + g.k_i * slow + 0.5 * q * (1.0 + back)
    explained = law.inertia * (1.0 - back) / law.period + 0.5 * law.damping * (1.0 + back)
    return on_ft, g.k_w * wash + q * explained, q * back


def link_response(
    law: FeedbackLaw, inertia: float, damping: float, corner: float, hz: FloatArray
) -> ComplexArray:
    """Return the law's response to the link's angle (N m/rad), with its delay of one sample (link.py)."""
    back, pole = 1.0 / z_of(law.period, hz), np.exp(-2.0 * np.pi * corner * law.period)
    rate = (1.0 - back) / law.period
    wanted = inertia * law.inertia * rate + 0.5 * damping * law.damping * (1.0 + back)
    action: ComplexArray = back * (1.0 - pole) / (1.0 - pole * back) * wanted * rate
    return action


def returns(
    law: FeedbackLaw,
    plant: ComplexArray,
    hz: FloatArray,
    path: ComplexArray | float = 1.0,
    current: ComplexArray | float = 1.0,
) -> tuple[ComplexArray, ComplexArray]:
    """Return the loop's memory N and D = N + the rest of the loop, shape (…, n): L = D / N - 1.

    plant: of `responses`, without the path; shape (4, …, n). path, current: from a command to the motor
    torque and to its measurement, beyond the one sample that is always present. N is 1 less the torque
    that is fed back; N / D is the sensitivity to a torque on the gear, 1 / D that to one on the command.
    """
    on_ft, on_velocity, memory = actions(law, hz)
    back = 1.0 / z_of(law.period, hz)
    fed_back = 1.0 - back * current * memory
    whole = fed_back + back * path * (on_ft * plant[FT] + on_velocity * plant[VELOCITY])
    return np.broadcast_to(fed_back, whole.shape), whole


def open_loop(law: FeedbackLaw, plant: ComplexArray, hz: FloatArray) -> ComplexArray:
    """Return L, the loop broken at the motor torque behind its current, shape (…, n)."""
    memory, whole = returns(law, plant, hz)
    return whole / memory - 1.0


def closed_loop_matrix(law: FeedbackLaw, plant: Sampled, share: float = 1.0) -> FloatArray:
    """Return the matrix that takes bench and law from one sample to the next, without a desired torque.

    Its columns are the answers of `feedback` and `hold` to unit states. share: of the torque that acts.
    """
    n, size = len(plant.a), len(plant.a) + len(FeedbackState._fields)
    columns = [_step(law, plant, unit[:n], FeedbackState(*unit[n:]), share) for unit in np.eye(size)]
    return np.column_stack(columns)


def largest_pole(law: FeedbackLaw, plant: Sampled, share: float = 1.0) -> float:
    """Return the largest modulus of a closed-loop pole: stable below 1."""
    return float(np.abs(np.linalg.eigvals(closed_loop_matrix(law, plant, share))).max())


def _step(law: FeedbackLaw, plant: Sampled, x: FloatArray, s: FeedbackState, share: float) -> FloatArray:
    y = plant.c @ x
    ft, velocity = float(y[FT]), float(y[VELOCITY])
    torque, after = feedback(law, s, -ft, -velocity, ft, velocity)
    return np.concatenate([plant.a @ x + plant.b * s.newest, hold(after, share * torque)])
