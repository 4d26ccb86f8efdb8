"""What an effect keeps of a sensor's past: a reading that is older than its stamp says."""

from rsea_ros.compiler import njit

LENGTH = 1023
"""Steps that are kept: 60 ms at a step of 60 us."""
RING = 2 + LENGTH
"""States of a ring: where the next reading goes, whether it has begun, and the readings."""


@njit(inline="always")
def older(x, at, reading, steps):  # type: ignore[no-untyped-def]
    """Put a reading into the ring at x[at], and return that of `steps` before, straight between two steps.

    Before the first reading there was the same.
    """
    if x[at + 1] == 0.0:
        for i in range(at + 2, at + RING):
            x[i] = reading
        x[at + 1] = 1.0
    steps = min(steps, LENGTH - 2.0)
    whole, now = int(steps), int(x[at])
    x[at + 2 + now] = reading
    x[at] = (now + 1) % LENGTH
    new = x[at + 2 + (now - whole) % LENGTH]
    return new + (steps - whole) * (x[at + 2 + (now - whole - 1) % LENGTH] - new)
