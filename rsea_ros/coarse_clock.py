"""The even sampling behind stamps of a clock that is coarser than the samples."""

from __future__ import annotations

import numpy as np

from rsea_ros.signals import FloatArray

_FEWEST_TICKS = 10
"""Fewer show no rate."""
_SLACK = 0.05
"""Of a tick: so far off may the line be that is drawn through stamps rounded to ticks."""


def even_behind_ticks(t: FloatArray) -> FloatArray | None:
    """Return the even stamps that a clock rounded to its ticks, s, shape of t; None where no such fit.

    The line through all samples, where each stamp lies within half a tick of it. A rate that wanders, a lost
    sample and a pause each leave that band, which rounding alone fills. t: s, not decreasing.
    """
    ticks = t[np.flatnonzero(np.diff(t, prepend=-np.inf) > 0.0)]
    if len(ticks) == len(t) or len(ticks) < _FEWEST_TICKS:
        return None
    tick = float(np.median(np.diff(ticks)))
    place = np.arange(len(t)) - 0.5 * (len(t) - 1)
    slope = float(place @ (t - t[0])) / float(place @ place)
    even: FloatArray = np.asarray(float(np.mean(t)) + slope * place)
    return even if np.max(np.abs(t - even)) <= (0.5 + _SLACK) * tick else None
