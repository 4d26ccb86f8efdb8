"""The lag of a channel behind its simulation, followed along a record: a straight line is a clock's rate.

In each block the lag moves by Gauss-Newton steps from that of the block before, with p' = dp/dt,

    lag -> lag - sum p' (y - p) / sum p'^2,   p read `lag` earlier,

so a drift of many radians by the end stays within a fraction of one from block to block. The blocks' lags are
weighted by what they show, sum p'^2.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rsea_ros.identification.unknowns import FASTEST
from rsea_ros.records.record import FloatArray

BLOCK = 1.0
"""s. At 500 ppm the lag changes by half a millisecond in it."""
_FEWEST = 8
"""Blocks: a line through fewer says little."""
_FEWEST_SAMPLES = 8
"""In a block."""
_STEPS, _FARTHEST = 4, 2e-3
"""Steps in a block, and how far all of them together may lead, s for each block since the last."""
_ALIKE = 0.7
"""Of a block's power: what the simulation must explain at its best lag."""
LEAST_RISE = 1e-3
"""s over the record: less turns no phase far, and a linear fit sees it."""
SCATTER = 0.25
"""Of the rise of a line: lags that scatter more about it do not follow a clock."""


class LagLine(NamedTuple):
    """A line through lags: rate (s/s), lag (s) at the start of the record, scatter of the lags about it (s),
    and how much the line rises over the record (s)."""

    rate: float
    at_start: float
    scatter: float
    rise: float

    @property
    def is_clear(self) -> bool:
        """Whether the lags follow a clock's line: too far for a linear fit, no faster than clocks run."""
        steep = abs(self.rise) > LEAST_RISE and abs(self.rate) < 1e-6 * FASTEST
        return steep and self.scatter < SCATTER * abs(self.rise)


def lag_line(t: FloatArray, y: FloatArray, p: FloatArray, start: float) -> LagLine | None:
    """Return the line of a channel's lag; None where the blocks do not show one.

    t: s, rising; y, p: measured and simulated, shape (n,), finite. start: of the record, s.
    """
    since, lag, weight = _lags(t, y, p, start)
    if len(lag) < _FEWEST:
        return None
    rate, at_start = np.polyfit(since, lag, 1, w=np.sqrt(weight))
    scatter = math.sqrt(float(np.average((lag - at_start - rate * since) ** 2, weights=weight)))
    return LagLine(float(rate), float(at_start), scatter, float(rate) * float(np.ptp(t)))


def _lags(
    t: FloatArray, y: FloatArray, p: FloatArray, start: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return middle (s since start), lag (s) and weight of the blocks that show a lag."""
    slope = np.gradient(p, t)
    since, lags, weight = [], [], []
    lag, last = 0.0, 0
    edges = np.searchsorted(t, np.arange(t[0], t[-1] + BLOCK, BLOCK))
    for k, (a, b) in enumerate(pairwise(edges.tolist())):
        if b - a < _FEWEST_SAMPLES:
            continue
        at, share = _lag_of(t[a:b], y[a:b], (t, p, slope), lag, _FARTHEST * (k + 1 - last))
        if share > _ALIKE:
            lag, last = at, k + 1
            since.append(float(np.mean(t[a:b])) - start)
            lags.append(lag)
            weight.append(float(np.sum(slope[a:b] ** 2)))
    return np.array(since), np.array(lags), np.array(weight)


def _lag_of(
    t: FloatArray, y: FloatArray, simulated: tuple[FloatArray, FloatArray, FloatArray], lag: float, far: float
) -> tuple[float, float]:
    """Return the lag of one block, and the share of its power that the simulation explains at it."""
    at, p, slope = simulated
    begin = lag
    for _ in range(_STEPS):
        values, slopes = np.interp(t - lag, at, p), np.interp(t - lag, at, slope)
        off = (y - values) - np.mean(y - values)
        size = float(slopes @ slopes)
        if size == 0.0:
            return begin, 0.0
        lag = float(np.clip(lag - float(slopes @ off) / size, begin - far, begin + far))
    residual = y - np.interp(t - lag, at, p)
    return lag, 1.0 - float(np.var(residual)) / max(float(np.var(y)), 1e-300)
