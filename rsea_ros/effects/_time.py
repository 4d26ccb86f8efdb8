"""Shared by effects in time: the progress of a drift, and the past of a sensor that is read late."""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects.effect import Parameter

SETTLING = Parameter(
    "time_constant", "s", null=math.inf, low=0.3, high=1e5, typical=1e5, starts=(3.0, 15.0), logarithmic=True,
    optional=True, is_fixed=True,
    reason="from a drift that settles within a run to one that is a straight line",
)
"""With which a drift settles; one that is hundreds of records long is a straight line."""
AGE = Parameter(
    "delay", "s", null=0.0, low=0.0, high=0.06, typical=5e-3, starts=(1e-3, 0.015, 0.03), is_fixed=True,
    reason="sensor networks, drives and serial adapters: one cycle at 1 kHz to three at 50 Hz",
)
"""Of a reading at its stamp."""
LENGTH = 1023
"""Steps that are kept: 60 ms at a step of 60 us."""
RING = 2 + LENGTH
"""States of a ring: where the next reading goes, whether it has begun, and the readings."""
_STRAIGHT = 1e8
"""Records: a drift with a longer time constant is its chord to the last digit."""


@njit(inline="always")
def progress(t, duration, time_constant):  # type: ignore[no-untyped-def]
    """Return t / duration, or (1 - exp(-t / T)) / (1 - exp(-duration / T)) for a drift that settles."""
    if time_constant > _STRAIGHT * duration:
        return t / duration
    return math.expm1(-t / time_constant) / math.expm1(-duration / time_constant)


@njit(inline="always")
def older(x, at, reading, steps):  # type: ignore[no-untyped-def]
    """Put a reading into the ring at x[at], and return that of `steps` before.

    Between two steps the cubic through them and their neighbours; within the last step, where the next one is
    not known, the parabola. Before the first reading there was the same.
    """
    if x[at + 1] == 0.0:
        for i in range(at + 2, at + RING):
            x[i] = reading
        x[at + 1] = 1.0
    steps = min(steps, LENGTH - 3.0)
    whole, now = int(steps), int(x[at])
    x[at + 2 + now] = reading
    x[at] = (now + 1) % LENGTH
    f, place = steps - whole, now - whole + LENGTH
    new, old = x[at + 2 + place % LENGTH], x[at + 2 + (place - 1) % LENGTH]
    oldest = x[at + 2 + (place - 2) % LENGTH]
    if whole == 0:
        return 0.5 * (1.0 - f) * (2.0 - f) * new + f * (2.0 - f) * old + 0.5 * f * (f - 1.0) * oldest
    newest = x[at + 2 + (place + 1) % LENGTH]
    between = 0.5 * (f + 1.0) * (2.0 - f) * ((1.0 - f) * new + f * old)
    return between - f * (1.0 - f) * ((2.0 - f) * newest + (f + 1.0) * oldest) / 6.0
