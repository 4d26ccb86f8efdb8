"""The requirements of an actuator."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsea_ros.documents.units import plain
from rsea_ros.errors import ParameterError

_LARGEST = 45.0
_RANGE = (1e-9, 1e6)
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
        for name, unit in _UNITS.items():
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


_UNITS = {
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
    if not _RANGE[0] <= value <= _RANGE[1]:
        unit = plain(unit)
        raise ParameterError(f"{name} = {value:g} {unit}, expected {_RANGE[0]:g} to {_RANGE[1]:g} {unit}")
