"""Shared by the drifts: their progress, 0 at the start of a record and 1 at its end."""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects.effect import Parameter

SETTLING = Parameter(
    "time_constant", "s", null=math.inf, low=0.3, high=1e5, typical=1e5, starts=(3.0, 15.0), logarithmic=True,
    optional=True, is_fixed=True,
    reason="from a drift that settles within a run to one that is a straight line",
)
"""With which a drift settles; one that is hundreds of records long is a straight line."""
_STRAIGHT = 1e8
"""Records: a drift with a longer time constant is its chord to the last digit."""


@njit(inline="always")
def progress(t, duration, time_constant):  # type: ignore[no-untyped-def]
    """Return t / duration, or (1 - exp(-t / T)) / (1 - exp(-duration / T)) for a drift that settles."""
    if time_constant > _STRAIGHT * duration:
        return t / duration
    return math.expm1(-t / time_constant) / math.expm1(-duration / time_constant)
