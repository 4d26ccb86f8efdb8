"""CUSUM of the likelihood ratio of each change, with a threshold from the rate of false alarms.

A parameter that is within its doubt, |change| <= inner, is right; one beyond outer is to be alarmed. By Wald,
for each parameter and each sign, a look adds

    s = ((outer - inner) c - (outer^2 - inner^2) A / 2) / phi,    g = max(0, g + s)

and E exp(s) <= 1 for every change up to inner. Hence (Lorden 1971) the mean number of looks to a false alarm
is at least exp(h): with m such sums and looks T apart false alarms come at most every exp(h) T / m. A look
without motion has c = A = 0 and adds nothing. phi is the variance of the scores over that of white
innovations. A single look adds at most a share of h: a knock or an outlier is no change.
Sources: Page, Biometrika 41, 1954; Lorden, Annals of Mathematical Statistics 42, 1971, theorem 2.
"""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.records.record import FloatArray

HOUR = 3600.0
SHARE = 0.34
"""Of the threshold that one look can add: three looks must agree."""
SUSPECT = 0.25
"""Of the threshold, from which a sum is a suspicion."""


def threshold(rate: float, sums: int, every: float) -> float:
    """Return h for a rate of false alarms an hour of a joint.

    sums: number of sums. every: s between looks.
    """
    return math.log(max(sums, 1) * HOUR / (rate * every))


class Cusum:
    """The sums of changes, both signs. inner, outer: shape (p,), in the unit of each. h: threshold."""

    def __init__(self, inner: FloatArray, outer: FloatArray, h: float) -> None:
        self._inner, self._outer, self.h = inner, outer, h
        self._linear, self._square = outer - inner, 0.5 * (outer**2 - inner**2)
        self.clear()

    def like(self, h: float) -> Cusum:
        """Return the same sums with another threshold."""
        return Cusum(self._inner, self._outer, h)

    def clear(self) -> None:
        """Restart."""
        self.sums = np.zeros((2, len(self._linear)))
        self.looks = np.zeros((2, len(self._linear)), dtype=np.int64)

    def take(self, score: FloatArray, information: FloatArray, phi: FloatArray) -> bool:
        """Process a look: scores, informations and dispersions of the changes, (p,); report an alarm."""
        gains = np.array([self._linear * sign * score - self._square * information for sign in (1.0, -1.0)])
        self.sums = np.maximum(0.0, self.sums + np.minimum(gains / phi, SHARE * self.h))
        self.looks = np.where(self.sums > 0.0, self.looks + 1, 0)
        return self.alarm

    @property
    def alarm(self) -> bool:
        """Whether a sum has reached the threshold."""
        return bool((self.sums >= self.h).any())

    @property
    def suspects(self) -> bool:
        """Whether a sum has grown so that more should be looked at."""
        return bool((self.sums > SUSPECT * self.h).any())

    @property
    def since(self) -> int:
        """Number of looks for which the largest sum has grown."""
        return int(self.looks.flat[int(np.argmax(self.sums))])
