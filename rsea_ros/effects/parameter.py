"""One parameter of an effect: its range, and the reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from rsea_ros.documents.units import with_unit
from rsea_ros.effects.scale import Scale, widest

_WIDENED = {"s", "Hz"}
"""Units of lags and modes: what a record shows goes with its samples, how large it is does not."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, SI, for the machine of scale.py.

    null: the value at which the effect vanishes. low, high: bounds of a fit. typical: a size that a bench
    may well have. starts: where fits begin besides `typical`, for problems with several minima.
    reason: why these bounds, with the source where one is known.
    is_fixed: the same on every machine, although its unit scales with a machine's size.
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
    def possible(self) -> tuple[float, float]:
        """Return the range that a person may state: the bounds on the smallest and the largest machine."""
        width = 1.0 if self.is_fixed else widest(self.unit)
        return self.low * width if self.low < 0.0 else self.low / width, self.high * width

    @property
    def bounds(self) -> str:
        """Return the possible values for people."""
        low, high = self.possible
        return with_unit(f"{low:g} to {high:g}", self.unit)
