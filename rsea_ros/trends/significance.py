"""False-alarm rates: of the largest of many scores, and of many findings at once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri, stdtr
from scipy.stats import t

from rsea_ros.records.record import FloatArray

_SMALLEST = 1e-280
_SUREST = 37.0
"""Normal score whose tail is the least that a double holds: rarer ones count as that rare."""
_KINDS = 2
"""A scan looks for steps and for ramps."""


def scan_p(largest: float, share: float, freedom: int) -> float:
    """Return how often noise alone makes a scan's largest |z| so large.

    share: of the days at each end where no change is looked for. freedom: of the estimated noise.
    Tail of the maximum of a standardised bridge (Miller and Siegmund 1982), for each kind of term.
    """
    b = min(_as_normal(abs(largest), freedom), _SUREST)
    if b < 1.5:
        return 1.0
    density = np.exp(-0.5 * b * b) / np.sqrt(2.0 * np.pi)
    rate = density * ((b - 1.0 / b) * np.log((1.0 - share) ** 2 / share**2) + 4.0 / b)
    return float(min(1.0, _KINDS * rate))


@lru_cache(maxsize=4096)
def scan_threshold(rate: float, share: float, freedom: int) -> float:
    """Return the |z| that noise alone reaches with a probability of `rate`."""
    return float(brentq(lambda z: np.log(scan_p(z, share, freedom) / rate), 1.6, 200.0))


def two_sided_p(z: float, freedom: float = np.inf) -> float:
    """Return how often noise alone makes a score so large on either side."""
    return float(2.0 * t.sf(abs(z), freedom))


def adjust(p: FloatArray) -> FloatArray:
    """Return for each p value the false discovery rate at which it counts (Benjamini and Hochberg 1995).

    p: shape (n,). Findings of one joint depend on each other, positively, under which the rate still holds
    (Benjamini and Yekutieli 2001, theorem 1.2).
    """
    if not len(p):
        return np.zeros(0)
    order = np.argsort(p)
    ranked = p[order] * len(p) / np.arange(1, len(p) + 1)
    q = np.empty(len(p))
    q[order] = np.minimum(1.0, np.minimum.accumulate(ranked[::-1])[::-1])
    return q


def _as_normal(score: float, freedom: int) -> float:
    """Return the normal score that is as rare as one of a Student variable."""
    tail = float(stdtr(freedom, -score))
    return float(-ndtri(tail)) if tail > _SMALLEST else float(np.sqrt(-2.0 * t.logsf(score, freedom)))
