"""Where a series of days falls into pieces: optimal partitioning, with the days weighted by their doubt.

Source: Jackson et al. (2005), An algorithm for optimal partitioning of data on an interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from rsea_ros.records.record import FloatArray

Piece = Literal["level", "line"]
"""What a piece is: a level, or a level with a slope."""
_MOST = 80
"""Places that are tried; the days between are looked at afterwards (course.py)."""


def breaks(
    t: FloatArray, y: FloatArray, w: FloatArray, piece: Piece, price: float, fewest: int
) -> Sequence[int]:
    """Return the first index of each piece but the first. price: of a piece, in twice log likelihood.

    The weights whiten: each is 1 over the variance of its day, interval and day effect together.
    """
    n = len(t)
    places = np.array([*range(0, n, -(-n // _MOST)), n])
    t = t - t.mean()
    columns = np.stack([w, w * y, w * y * y, w * t, w * t * t, w * t * y])
    sums = np.concatenate([np.zeros((6, 1)), np.cumsum(columns, axis=1)], axis=1)[:, places]
    least, before = np.full(len(places), np.inf), np.zeros(len(places), int)
    least[0] = 0.0
    for end in range(1, len(places)):
        starts = np.flatnonzero((places[end] - places >= fewest) & np.isfinite(least))
        if len(starts):
            costs = least[starts] + _cost(sums[:, end, None] - sums[:, starts], piece) + price
            least[end], before[end] = costs.min(), starts[np.argmin(costs)]
    found, end = [], int(before[-1])
    while end:
        found.append(int(places[end]))
        end = int(before[end])
    return found[::-1]


def _cost(sums: FloatArray, piece: Piece) -> FloatArray:
    """Return the weighted sums of squares about the level or line of pieces, from their sums."""
    w, wy, wyy, wt, wtt, wty = sums
    cost: FloatArray = wyy - wy * wy / w
    if piece == "level":
        return cost
    spread = wtt - wt * wt / w
    is_line = spread > 1e-12 * wtt
    return np.where(is_line, cost - (wty - wt * wy / w) ** 2 / np.where(is_line, spread, 1.0), cost)
