"""How much the days scatter beyond their intervals: one random effect a day, its variance by REML."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.trends.days import Days
from rsea_ros.trends.settings import TrendSettings

_COARSE, _FINE = 24, 9
_SHORTEST, _BLOCKS = 4, 6
"""Days of a block, and blocks, of a short series: one long block would take a step for scatter."""


@dataclass(frozen=True)
class DayEffect:
    """variance: of the day effect, in units of the series' scale squared. freedom: degrees of freedom of it.

    per_kelvin, per_kelvin_sd: of the temperature within blocks of days, per K; sd infinite where unknown.
    """

    variance: float
    freedom: int
    per_kelvin: float
    per_kelvin_sd: float


def day_effect(days: Days, settings: TrendSettings, taken: FloatArray | float = 0.0) -> DayEffect:
    """Return the day effect from the scatter within blocks of days, so that a change counts little.

    taken: known course over time, subtracted first, in units of the scale, shape (n,).
    Restricted likelihood (Patterson and Thompson 1971) with a level for each block and a temperature slope.
    """
    n = len(days.t)
    length = min(settings.block_days, max(_SHORTEST, n // _BLOCKS))
    blocks = np.linspace(0, n, max(1, n // length) + 1).astype(int)[:-1]
    y = days.y - taken
    columns = 0 if days.warmth is None else 1
    freedom = n - len(blocks) - columns
    if freedom < 2:
        return DayEffect(float(np.var(y)) if n > 1 else 0.0, 1, 0.0, np.inf)
    typical = float(np.median(days.variance)) + float(np.var(y)) + 1e-18
    grid = np.concatenate([[0.0], np.geomspace(1e-5 * typical, 10.0 * typical, _COARSE)])
    at = int(np.argmin(_criterion(days, y, blocks, grid)[0]))
    grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], _FINE)
    criterion, slope, slope_sd = _criterion(days, y, blocks, grid)
    at = int(np.argmin(criterion))
    return DayEffect(float(grid[at]), freedom, float(slope[at]), float(slope_sd[at]))


def _criterion(
    days: Days, y: FloatArray, blocks: np.ndarray, grid: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return -2 log restricted likelihood, temperature slope and its sd at each variance of a grid."""
    w = 1.0 / (days.variance + grid[:, None])
    total = np.add.reduceat(w, blocks, axis=1)

    def product(a: FloatArray, b: FloatArray) -> FloatArray:
        """Return the weighted product of two columns about their block means."""
        apart = np.add.reduceat(w * a, blocks, axis=1) * np.add.reduceat(w * b, blocks, axis=1) / total
        total_of: FloatArray = np.sum(w * a * b, axis=1) - np.sum(apart, axis=1)
        return total_of

    criterion = -np.sum(np.log(w), axis=1) + np.sum(np.log(total), axis=1)
    if days.warmth is None:
        return criterion + product(y, y), np.zeros(len(grid)), np.full(len(grid), np.inf)
    square = np.maximum(product(days.warmth, days.warmth), 1e-12)
    cross = product(days.warmth, y)
    criterion = criterion + product(y, y) - cross**2 / square + np.log(square)
    return criterion, cross / square, 1.0 / np.sqrt(square)
