"""Few numbers that draw the same picture: the extremes of each batch, in the order in which they came."""

from __future__ import annotations

from collections.abc import Sequence

Samples = Sequence[tuple[float, float]]
"""Time, s, and value of each sample."""


def extremes(samples: Samples) -> Samples:
    """Return the least and the largest of some samples in order, one where they are the same, none of none.

    Not-a-number is left out.
    """
    known = [s for s in samples if s[1] == s[1]]
    if len(known) < 2:
        return known
    low, high = min(known, key=_value), max(known, key=_value)
    if low is high:
        return [known[-1]]
    return [low, high] if low[0] <= high[0] else [high, low]


def _value(sample: tuple[float, float]) -> float:
    return sample[1]
