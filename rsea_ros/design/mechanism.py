"""The requirements of an actuator, and the mechanisms of its design: spring and train.

T = 2 K (R^2 + r_s^2 / 3) sin(theta) cos(theta) = (K_s / 2) sin(2 theta)     Eq. (8)

so no deflection carries more than K_s / 2, at 45 degrees; the paper does not say so.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rsea_ros.documents.units import plain
from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray

_LARGEST = 45.0
RANGE = (1e-9, 1e6)
"""SI: beyond it nothing of this kind has ever been built, and numbers fail."""


@dataclass(frozen=True)
class Requirement:
    """The defaults are the paper's knee (section 4.1), with the deflection limit of section 3.1.2.

    torque: N m. bandwidth: Hz. inertia, mass, diameter: of the spring chassis, kg m^2, kg, m. separation:
    between two springs, twice the arm, m. spring_radius: m. deflection: rad. tolerance_db, tolerance_deg: of
    T_d / T_p.
    """

    torque: float = 150.0
    bandwidth: float = 50.0
    inertia: float = 6.169e-4
    mass: float = 0.245
    diameter: float = 0.12
    separation: float = 0.0508
    spring_radius: float = 0.0131
    deflection: float = math.radians(5.0)
    tolerance_db: float = 3.0
    tolerance_deg: float = 90.0

    def __post_init__(self) -> None:
        for name, unit in UNITS.items():
            value = getattr(self, name)
            check_magnitude(name, value, unit)
        if self.deflection > math.radians(_LARGEST):
            raise ParameterError(
                f"deflection = {math.degrees(self.deflection):g} deg, expected at most {_LARGEST:g} deg"
            )
        if self.separation > self.diameter:
            raise ParameterError(
                f"separation = {self.separation:g} m, expected within the diameter of {self.diameter:g} m"
            )

    @property
    def arm(self) -> float:
        """R, m: half the separation."""
        return 0.5 * self.separation


UNITS = {
    "torque": "N m",
    "bandwidth": "Hz",
    "inertia": "kg m^2",
    "mass": "kg",
    "diameter": "m",
    "separation": "m",
    "spring_radius": "m",
    "deflection": "rad",
    "tolerance_db": "dB",
    "tolerance_deg": "deg",
}


def check_magnitude(name: str, value: float, unit: str) -> None:
    """Raise ParameterError for a value that is not finite and positive, or of no possible size."""
    if not RANGE[0] <= value <= RANGE[1]:
        unit = plain(unit)
        raise ParameterError(f"{name} = {value:g} {unit}, expected {RANGE[0]:g} to {RANGE[1]:g} {unit}")


Values = float | FloatArray


def largest_torque(k_s: Values) -> FloatArray:
    """Return K_s / 2, N m, the torque of the mechanism at 45 degrees. k_s: N m/rad."""
    return np.asarray(0.5 * np.asarray(k_s))


def deflection(k_s: Values, torque: Values) -> FloatArray:
    """Return theta = asin(2 T / K_s) / 2, rad, of Eq. (8); nan above K_s / 2."""
    sine = np.divide(2.0 * np.asarray(torque), k_s)
    inside: npt.NDArray[np.bool_] = np.abs(sine) <= 1.0
    return np.where(inside, 0.5 * np.arcsin(np.where(inside, sine, 0.0)), np.nan)


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
