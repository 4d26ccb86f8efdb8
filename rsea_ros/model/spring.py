"""The elastic element: two pairs of linear springs on an arm (paper, section 3.1.2), Eq. (9) turned round."""

from __future__ import annotations

import math

from rsea_ros.errors import ParameterError


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
