"""One parameter of an effect: its range, the reason, and how it goes with the size of a machine.

Similar machines move alike (Buckingham, Phys. Rev. 4, 1914): where torques, stiffnesses and inertias are all
s times as large, angles and times stay the same, and 2 N·m of friction on one are 2 s N·m on the other. So
bounds, sizes and starts of an effect go with their units as powers of five numbers of the machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from rsea_ros.documents.units import with_unit

_WIDENED = {"s", "Hz"}
"""Units of lags and modes: what a record shows goes with its samples, how large it is does not."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, SI, for the machine below.

    null: the value at which the effect vanishes. low, high: bounds of a fit. typical: a size that a bench
    may well have. starts: where fits begin besides `typical`, for problems with several minima.
    reason: why these bounds, with the source where one is known.
    is_fixed: the same on every machine, although its unit scales with a machine's size.
    jumps: the law jumps where a signal reaches it, so that only steps between samples show its derivative.
    ideal_at_low: at its low bound the law is the ideal one, so that this bound is no sign of another law.
    optional: may be left out; then it is `null`.
    spread: one sigma of its prior around its start: of its logarithm where that is
    fitted, else absolute; inf for nothing. `reason` names the source.
    shapes: counts in the size of the law although it may be left out: it makes another law of it.
    per_record: differs from record to record, such as the phase of the mains at its start.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    typical: float
    starts: tuple[float, ...] = ()
    logarithmic: bool = False
    optional: bool = False
    spread: float = math.inf
    shapes: bool = False
    per_record: bool = False
    is_fixed: bool = False
    ideal_at_low: bool = False
    jumps: bool = False
    reason: str = ""

    def at(self, scale: Scale) -> Parameter:
        """Return the parameter with the bounds, size and starts that suit a machine; null stays.

        Lags and frequencies keep their size, and bounds that only widen: buses and structures are not faster
        on a machine that is sampled faster.
        """
        factor = 1.0 if self.is_fixed else scale.factor(self.unit)
        if factor == 1.0:
            return self
        if self.unit in _WIDENED:
            return replace(self, low=self.low * min(factor, 1.0), high=self.high * max(factor, 1.0))
        starts = tuple(factor * s for s in self.starts)
        low, high, typical = (factor * v for v in (self.low, self.high, self.typical))
        return replace(self, low=low, high=high, typical=typical, starts=starts)

    def widen(self, value: float) -> Parameter:
        """Return the parameter with bounds that hold a value which a rig states, where that is a number."""
        if not math.isfinite(value) or (self.logarithmic and value <= 0.0):
            return self
        return replace(self, low=min(self.low, value), high=max(self.high, value))

    @property
    def is_counted(self) -> bool:
        """Whether a law with this parameter is larger than one without."""
        return self.shapes or not self.optional

    @property
    def is_share(self) -> bool:
        """Whether it is a share, whose bounds are none and all."""
        return self.unit == "1" and (self.low, self.high) == (0.0, 1.0)

    @property
    def possible(self) -> tuple[float, float]:
        """Return the range that a person may state: the bounds on the smallest and the largest machine."""
        width = 1.0 if self.is_fixed else widest(self.unit)
        return self.low * width if self.low < 0.0 else self.low / width, self.high * width

    @property
    def bounds(self) -> str:
        """Return the possible values for people."""
        low, high = self.possible
        return with_unit(f"{low:g} to {high:g}", self.unit)


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
        powers, most = POWERS.get(unit, ()), widest(unit)
        factor = math.prod(float(getattr(self, name)) ** power for name, power in powers)
        return min(max(factor, 1.0 / most), most)


POWERS: dict[str, tuple[tuple[str, int], ...]] = {
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


PHASE = Parameter(
    "phase", "rad", null=0.0, low=-2.0 * math.pi, high=2.0 * math.pi, typical=0.7, starts=(-2.4, -0.9, 2.3),
    is_fixed=True, reason="one turn either way, so that a fit can pass the end of a turn",
)


def scale_to(torque: float, stiffness: float, inertia: float, speed: float, period: float) -> Scale:
    """Return the scale of a machine: largest torque, N m, stiffness, N m/rad, inertia, kg m^2, and so on.

    An unknown number, zero or not finite, counts as the catalogue's.
    """
    sizes = (torque, stiffness, inertia, speed, period)
    beside = (TORQUE, STIFFNESS, INERTIA, SPEED, PERIOD)
    names = (f.name for f in fields(Scale))
    return Scale(**{n: _on_grid(a / b) for n, a, b in zip(names, sizes, beside, strict=True)})


def widest(unit: str) -> float:
    """Return how many times larger a number of a unit may be on any machine than on the catalogue's."""
    return _WIDEST.get(unit, _GRID**_MOST) if unit in POWERS else 1.0


def _on_grid(ratio: float) -> float:
    """Return the power of 4 nearest to a ratio."""
    if not (math.isfinite(ratio) and ratio > 0.0):
        return 1.0
    power = round(math.log(ratio, _GRID))
    return float(_GRID ** min(max(power, -_MOST), _MOST))
