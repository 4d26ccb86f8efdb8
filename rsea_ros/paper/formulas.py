"""The paper's formulas as printed, Eqs. (1) to (10); the model in `model/equations.py` is exact.

Eq. (7) is in `model/transfer.py`: the design method needs it too.

k_s: N m/rad; j_*: kg m^2; b_*: N m s/rad, at the gear output, but for `*_rotor`, which are at the rotor
(times N^2 at the output). The term that Eqs. (5) to (7) leave out is in docs/physics.md.
"""

import math

import numpy as np

from rsea_ros.model.transfer import Fraction

EXACT_FACTOR = 1.0 - math.sqrt(0.5)
"""0.29289: in the place of 0.292: where an undamped |T_d / T_p| has risen by the factor sqrt(2)."""


def _over(numerator: list[float], denominator: list[float]) -> Fraction:
    return Fraction(np.array(numerator), np.array(denominator))


def eq_1_lumped_distal_per_motor(k_s: float, j_eff: float, b_eff: float) -> Fraction:
    """Return T_d / T_m = K_s / (J_eff s^2 + b_eff s + K_s), lumped. Paper, Eq. (1)."""
    return _over([k_s], [j_eff, b_eff, k_s])


def eq_2_lumped_proximal_per_motor(k_s: float, j_eff: float, b_eff: float, b_s: float) -> Fraction:
    """Return T_p / T_m = (J_eff s^2 + b_s s + K_s) / (J_eff s^2 + b_eff s + K_s), lumped. Paper, Eq. (2)."""
    return _over([j_eff, b_s, k_s], [j_eff, b_eff, k_s])


def eq_3_lumped_distal_per_proximal(k_s: float, j_eff: float, b_s: float) -> Fraction:
    """Return T_d / T_p = K_s / (J_eff s^2 + b_s s + K_s), lumped. Paper, Eq. (3)."""
    return _over([k_s], [j_eff, b_s, k_s])


def eq_5_proximal_per_motor(
    k_s: float, j_rotor: float, b_rotor: float, ratio: float, j_sc: float, b_s: float
) -> Fraction:
    """Return T_p / T_m = (J_sc s^2 + b_s s + K_s) / (denominator of Eq. (4)). Paper, Eq. (5)."""
    return _over([j_sc, b_s, k_s], [j_rotor * ratio**2 + j_sc, b_rotor * ratio**2 + b_s, k_s])


def eq_6_distal_per_proximal(k_s: float, j_sc: float, b_s: float) -> Fraction:
    """Return T_d / T_p = K_s / (J_sc s^2 + b_s s + K_s). Paper, Eq. (6)."""
    return _over([k_s], [j_sc, b_s, k_s])


def eq_8_spring_torque(k: float, radius: float, spring_radius: float, theta: float) -> float:
    """Return T = 2 K (R^2 + r_s^2 / 3) sin(theta) cos(theta), N m. Paper, Eq. (8).

    k: N/m, of one linear spring. radius: moment arm R, m. spring_radius: r_s, m. theta: rad.
    """
    return 2.0 * k * (radius**2 + spring_radius**2 / 3.0) * math.sin(theta) * math.cos(theta)


def eq_9_spring_stiffness(k: float, radius: float, spring_radius: float, theta: float = 0.0) -> float:
    """Return K_s = 2 K (R^2 + r_s^2 / 3) (2 cos^2(theta) - 1), N m/rad, slope of Eq. (8). Paper, Eq. (9)."""
    return 2.0 * k * (radius**2 + spring_radius**2 / 3.0) * (2.0 * math.cos(theta) ** 2 - 1.0)


EQ_10 = (1560.436, 27.267, 1638.783)
"""Fit to the high-impedance test: c_0 / (s^2 + c_1 s + c_2). Paper, Eq. (10)."""


def eq_10_inertia_and_damping(k_s: float) -> tuple[float, float]:
    """Return J_eff (kg m^2) and b_eff (N m s/rad) as the paper has them: both K_s / J_eff averaged.

    That hides a gain of c_0 / c_2 = 0.952 at rest, which a torque constant or friction makes.
    """
    c_0, c_1, c_2 = EQ_10
    j_eff = k_s / (0.5 * (c_0 + c_2))
    return j_eff, c_1 * j_eff
