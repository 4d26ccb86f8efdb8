"""The size of a machine and of its record, beside the machine for which the catalogue states its numbers.

Similar machines move alike (Buckingham, Phys. Rev. 4, 1914): where torques, stiffnesses and inertias are all
s times as large, angles and times stay the same, and 2 N·m of friction on one are 2 s N·m on the other. So
bounds, sizes and starts of an effect go with their units as powers of five numbers of the machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

TORQUE, STIFFNESS, INERTIA, SPEED, PERIOD = 30.0, 1500.0, 1.0, 0.6, 1.0 / 280.0
"""The machine for which the catalogue states its numbers: largest torque of a run, N m, stiffness of its
spring, N m/rad, reflected inertia, kg m^2, largest speed, rad/s, and time between samples, s. The paper's
actuator in its high-impedance test."""
MACHINE = (
    f"a machine of {TORQUE:g} N·m, {STIFFNESS:g} N·m/rad, {INERTIA:g} kg·m², {SPEED:g} rad/s "
    f"and {1.0 / PERIOD:.0f} samples a second"
)
_GRID = 4.0
"""Scales are powers of it: a size is typical to a factor of two, and records of one machine share it."""
_MOST = 6
"""Largest power: a machine 4096 times as strong."""


@dataclass(frozen=True)
class Scale:
    """How many times larger than the catalogue's the numbers of a machine and its record are: powers of 4."""

    torque: float = 1.0
    stiffness: float = 1.0
    inertia: float = 1.0
    speed: float = 1.0
    period: float = 1.0

    def factor(self, unit: str) -> float:
        """Return by how much a number of a unit is larger; 1 for a unit that says nothing of the machine."""
        powers, most = _POWERS.get(unit, ()), widest(unit)
        factor = math.prod(float(getattr(self, name)) ** power for name, power in powers)
        return min(max(factor, 1.0 / most), most)


_POWERS: dict[str, tuple[tuple[str, int], ...]] = {
    "N m": (("torque", 1),),
    "1/(N m)": (("torque", -1),),
    "N m/rad": (("stiffness", 1),),
    "N m s/rad": (("torque", 1), ("speed", -1)),
    "N m s^2/rad^2": (("torque", 1), ("speed", -2)),
    "kg m^2": (("inertia", 1),),
    "rad": (("torque", 1), ("stiffness", -1)),
    "1/rad": (("torque", -1), ("stiffness", 1)),
    "1/rad^2": (("torque", -2), ("stiffness", 2)),
    "rad/s": (("speed", 1),),
    "s": (("period", 1),),
    "Hz": (("period", -1),),
}
"""Powers of a machine's numbers by unit. An angle is the deflection that the largest torque makes."""
_WIDEST = {"rad": 64.0, "1/rad": 64.0, "s": 64.0, "Hz": 64.0}
"""How far some units may go: springs of a few mrad to some rad, records of 5 Hz to 18 kHz."""


def scale_to(torque: float, stiffness: float, inertia: float, speed: float, period: float) -> Scale:
    """Return the scale of a machine: largest torque, N m, stiffness, N m/rad, inertia, kg m^2, and so on.

    An unknown number, zero or not finite, counts as the catalogue's.
    """
    sizes = (torque, stiffness, inertia, speed, period)
    beside = (TORQUE, STIFFNESS, INERTIA, SPEED, PERIOD)
    names = (f.name for f in fields(Scale))
    return Scale(**{n: _on_grid(a / b) for n, a, b in zip(names, sizes, beside, strict=True)})


def powers_of(unit: str) -> tuple[tuple[str, int], ...]:
    """Return with which numbers of a machine, to which power, a number of a unit grows."""
    return _POWERS.get(unit, ())


def widest(unit: str) -> float:
    """Return how many times larger a number of a unit may be on any machine than on the catalogue's."""
    return _WIDEST.get(unit, _GRID**_MOST) if unit in _POWERS else 1.0


def _on_grid(ratio: float) -> float:
    """Return the power of 4 nearest to a ratio."""
    if not (math.isfinite(ratio) and ratio > 0.0):
        return 1.0
    power = round(math.log(ratio, _GRID))
    return float(_GRID ** min(max(power, -_MOST), _MOST))
