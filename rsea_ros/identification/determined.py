"""Whether the data or the prior determine a value: one answer for a check and for a fit."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from rsea_ros.records.record import FloatArray

Determined = Literal["yes", "in part", "no"]
IDENTIFIABLE_SHARE = 0.5
"""Share of what is known of a value that the data must have brought for it to be identified."""
_WELL = 0.9
"""The same for a value that the data determine whole."""
_NULL = 1e-9
"""Of the prior's information: what stands in for none, so that data that say nothing give a wide variance."""


def shares_from_data(information: FloatArray, doubt: FloatArray) -> FloatArray:
    """Return for each unknown the share of its information that comes from the data, 0 … 1, shape (n,).

    d^2 / (d^2 + v) with d the doubt before and v the variance that the data alone leave, all other unknowns
    free: 0 where only a ratio with others is determined. information: J'J, shape (n, n).
    """
    scaled = information * np.outer(doubt, doubt) + _NULL * np.eye(len(doubt))
    return np.asarray(1.0 / (1.0 + _variances(scaled)))


def _variances(information: FloatArray) -> FloatArray:
    """Return the variance that an information leaves of each unknown; where rounding leaves it singular,
    directions below the rounding count as unknown."""
    try:
        return np.diag(np.linalg.inv(information))
    except np.linalg.LinAlgError:
        size, vectors = np.linalg.eigh(information)
        return np.asarray(vectors**2 @ (1.0 / np.maximum(size, _NULL)))


def how_determined(name: str, value: float, ci95: tuple[float, float], share: float) -> Determined:
    """Return how well data determine a value, relative to its prior and to its size.

    "no" where the interval reaches as far as the value is large, or where the fit ended at a bound.
    """
    low, high = ci95
    at_bound = value in ci95 and low < high
    size = math.pi if name.endswith(".phase") else abs(value)
    if share < IDENTIFIABLE_SHARE or at_bound or not max(high - value, value - low) < size:
        return "no"
    return "yes" if share >= _WELL else "in part"
