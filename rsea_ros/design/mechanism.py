"""Mechanisms of the design: spring and train.

T = 2 K (R^2 + r_s^2 / 3) sin(theta) cos(theta) = (K_s / 2) sin(2 theta)     Eq. (8)

so no deflection carries more than K_s / 2, at 45 degrees; the paper does not say so.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray

Values = float | FloatArray


def largest_torque(k_s: Values) -> FloatArray:
    """Return K_s / 2, N m, the torque of the mechanism at 45 degrees. k_s: N m/rad."""
    return np.asarray(0.5 * np.asarray(k_s))


def deflection(k_s: Values, torque: Values) -> FloatArray:
    """Return theta = asin(2 T / K_s) / 2, rad, of Eq. (8); nan above K_s / 2."""
    sine = np.divide(2.0 * np.asarray(torque), k_s)
    inside: npt.NDArray[np.bool_] = np.abs(sine) <= 1.0
    return np.where(inside, 0.5 * np.arcsin(np.where(inside, sine, 0.0)), np.nan)


def linear_deflection(k_s: Values, torque: Values) -> FloatArray:
    """Return T / K_s, rad: the deflection if the spring were linear."""
    return np.divide(torque, k_s)


def linearity_error(theta: Values) -> FloatArray:
    """Return 1 - sin(2 theta) / (2 theta): the share of K_s theta that Eq. (8) does not give. theta: rad."""
    return np.asarray(1.0 - np.sinc(2.0 * np.asarray(theta) / np.pi))


def stiffness_for_deflection(torque: float, limit: float) -> float:
    """Return K_s = 2 T / sin(2 theta), N m/rad, the least that stays within a deflection (rad, to pi / 4)."""
    return float(2.0 * torque / np.sin(2.0 * min(limit, 0.25 * np.pi)))


def spring_radius(k_s: float, k: float, radius: float) -> float:
    """Return r_s = sqrt(3 (K_s / (2 K) - R^2)), m, of Eq. (9) at theta = 0.

    k_s: N m/rad. k: N/m, of one linear spring. radius: moment arm R, m.
    Raises ParameterError when the arm alone makes the joint stiffer than k_s.
    """
    square = 3.0 * (k_s / (2.0 * k) - radius**2)
    if square < 0.0:
        least = 2.0 * k * radius**2
        raise ParameterError(f"K_s = {k_s:g} N·m/rad, expected at least 2 K R^2 = {least:g} N·m/rad")
    return math.sqrt(square)


def spring_rate(k_s: float, radius: float, spring_radius: float) -> float:
    """Return K = K_s / (2 (R^2 + r_s^2 / 3)), N/m, of one linear spring, of Eq. (9) at theta = 0."""
    return k_s / (2.0 * (radius**2 + spring_radius**2 / 3.0))
