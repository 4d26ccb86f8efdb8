"""The innovation test: do the sensors agree within their noise?

Where the model is right nu^2 / S, the squared innovation over its variance, is chi-square distributed with
one degree of freedom and white: the sum over a window of n samples has n degrees of freedom.
Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from scipy.special import chdtri  # chi2.isf, without the 0.3 s of scipy.stats

from rsea_ros.records.record import FloatArray

CHANNELS = ("position", "ft", "motor_torque")
FALSE_ALARM = 1e-6
"""Probability that a right model is called inconsistent in a window: once in ten days of windows of 1 s."""


class Consistency(NamedTuple):
    """ratio: RMS of the innovations over its expected value.

    limit: the largest allowed. mean: in the channel's unit.
    """

    ratio: float
    limit: float
    mean: float

    @property
    def broken(self) -> bool:
        """Whether the model is inconsistent with this channel."""
        return self.ratio > self.limit


def consistency(score: FloatArray) -> dict[str, Consistency]:
    """Return the test of each channel that had samples. score: sums of nu^2 / S, 1, nu, shape (3, 3).

    A late sample changes innovations that were already counted, so a sum may decrease: to zero at least.
    """
    return {
        name: Consistency(math.sqrt(max(total, 0.0) / count), _limit(round(count)), sum_ / count)
        for name, (total, count, sum_) in zip(CHANNELS, score.tolist(), strict=True)
        if count >= 1.0 and math.isfinite(total + sum_)
    }


@lru_cache(maxsize=64)
def _limit(count: int) -> float:
    return math.sqrt(float(chdtri(count, FALSE_ALARM)) / count)
