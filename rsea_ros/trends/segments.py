"""Where a series of days falls into pieces: PELT of ruptures, with the days weighted by their doubt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from ruptures.base import BaseCost
from ruptures.detection import Pelt

from rsea_ros.records.record import FloatArray

Piece = Literal["level", "line"]
"""What a piece is: a level, or a level with a slope."""
_MOST = 80
"""Places that PELT looks at, in pure Python; the days between are looked at afterwards (course.py)."""


class WeightedPieces(BaseCost):  # type: ignore[misc]
    """Weighted sum of squares about the level or line of a piece, in constant time from running sums.

    The weights whiten: each is 1 over the variance of its day, interval and day effect together.
    """

    model = "weighted"

    def __init__(self, t: FloatArray, y: FloatArray, w: FloatArray, piece: Piece, fewest: int) -> None:
        self.min_size = fewest
        self._line = piece == "line"
        t = t - t.mean()
        columns = np.stack([w, w * y, w * y * y, w * t, w * t * t, w * t * y])
        sums = np.concatenate([np.zeros((6, 1)), np.cumsum(columns, axis=1)], axis=1)
        self._sums: list[tuple[float, ...]] = [tuple(row) for row in sums.T.tolist()]

    def fit(self, signal: Any) -> WeightedPieces:
        """Return itself: the sums are made already."""
        self.signal = signal
        return self

    def error(self, start: int, end: int) -> float:
        """Return the cost of a piece."""
        first, last = self._sums[start], self._sums[end]
        w, wy, wyy = last[0] - first[0], last[1] - first[1], last[2] - first[2]
        cost = wyy - wy * wy / w
        if not self._line:
            return cost
        wt, wtt, wty = last[3] - first[3], last[4] - first[4], last[5] - first[5]
        spread = wtt - wt * wt / w
        return cost - (wty - wt * wy / w) ** 2 / spread if spread > 1e-12 * wtt else cost


def breaks(
    t: FloatArray, y: FloatArray, w: FloatArray, piece: Piece, price: float, fewest: int
) -> Sequence[int]:
    """Return the first index of each piece but the first. price: of a piece, in twice log likelihood."""
    n = len(t)
    if n < 2 * fewest:
        return []
    jump = -(-n // _MOST)
    cost = WeightedPieces(t, y, w, piece, fewest)
    search = Pelt(custom_cost=cost, min_size=fewest, jump=jump).fit(y.reshape(-1, 1))
    return [int(i) for i in search.predict(pen=price)[:-1]]
