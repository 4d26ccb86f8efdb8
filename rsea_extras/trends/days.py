"""Days: effects of single days, and of temperature."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from rsea_extras.trends.series import DAY, BoolArray, Series, TrendSettings
from rsea_ros.extension.base import MAD_TO_SD, FloatArray

_NEIGHBOURS = 9
"""Recordings of the running median: three alike at an end outvote the others."""


@dataclass(frozen=True)
class Days:
    """Means of the days, each array of shape (n,).

    t: days since 1970, mean of the day's recordings. y, variance: in units of `scale`, the series' typical
    size. warmth: K above `temperature`, the mean; None where the temperature is not logged.
    """

    t: FloatArray
    y: FloatArray
    variance: FloatArray
    warmth: FloatArray | None
    temperature: float
    scale: float


def day_means(series: Series, settings: TrendSettings) -> Days:
    """Return the weighted means of the days that determine the parameter, lone outliers left out."""
    s = series.keep(series.identifiable)
    s = s.keep(~outliers(s.time_s, s.value, s.sd, settings.outlier_days))
    size = np.abs(s.value)
    scale = float(np.median(size) or np.max(size) or 1.0) if len(size) else 1.0
    day = np.floor(s.time_s / DAY)
    starts = np.flatnonzero(np.diff(day, prepend=-np.inf))
    y, variance = s.value / scale, np.maximum(s.sd / scale, 1e-9) ** 2
    weight = 1.0 / (variance + _beyond(y, variance, starts))
    total = np.add.reduceat(weight, starts) if len(starts) else weight
    warmth, mean = _warmth(s.temperature)

    def average(values: FloatArray) -> FloatArray:
        return np.add.reduceat(weight * values, starts) / total if len(starts) else values

    t, warm = day[starts] + average(s.time_s / DAY - day), None if warmth is None else average(warmth)
    return Days(t, average(y), 1.0 / total, warm, mean, scale)


def outliers(time_s: FloatArray, value: FloatArray, sd: FloatArray, most: float) -> BoolArray:
    """Return which recordings lie farther than `most` standard deviations from their neighbours.

    From their median, and from their line as well: at the end of a ramp all neighbours lie on one side.
    """
    if len(value) < _NEIGHBOURS:
        return np.zeros(len(value), bool)
    far = _are_far(value - median_filter(value, _NEIGHBOURS, mode="mirror"), sd, most)
    return far & _are_far(value - _on_lines(time_s, value), sd, most) if np.any(far) else far


def _are_far(off: FloatArray, sd: FloatArray, most: float) -> BoolArray:
    spread = MAD_TO_SD * float(np.median(np.abs(off)))
    return np.asarray(np.abs(off) > most * np.sqrt(spread**2 + sd**2))


def _on_lines(time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return the line through the neighbours of each recording at its time (Theil 1950, Sen 1968)."""
    n = len(value)
    first = np.clip(np.arange(n) - _NEIGHBOURS // 2, 0, n - _NEIGHBOURS)
    near = first[:, None] + np.arange(_NEIGHBOURS)
    near = near[near != np.arange(n)[:, None]].reshape(n, -1)
    t, y = time_s[near] - time_s[:, None], value[near]
    i, j = np.triu_indices(near.shape[1], 1)
    apart = t[:, j] - t[:, i]
    rise = np.where(apart > 0.0, (y[:, j] - y[:, i]) / np.where(apart > 0.0, apart, 1.0), 0.0)
    slope = np.median(rise, axis=1)
    return np.asarray(np.median(y - slope[:, None] * t, axis=1))


def _beyond(y: FloatArray, variance: FloatArray, starts: np.ndarray) -> float:
    """Return the variance within groups beyond that of each value (DerSimonian and Laird 1986).

    starts: place of the first value of each group.
    """
    if len(starts) in (0, len(y)):
        return 0.0
    w = 1.0 / variance
    total = np.add.reduceat(w, starts)
    mean = np.add.reduceat(w * y, starts) / total
    q = float(np.sum(w * y**2) - np.sum(total * mean**2))
    room = float(np.sum(total - np.add.reduceat(w**2, starts) / total))
    return max(0.0, (q - (len(y) - len(starts))) / room) if room > 0.0 else 0.0


def _warmth(temperature: FloatArray) -> tuple[FloatArray | None, float]:
    """Return K above the mean, 0 where unknown; None where most are unknown or all are the same."""
    known = np.isfinite(temperature)
    if np.sum(known) < 0.5 * len(temperature) or not np.any(known):
        return None, float("nan")
    mean = float(np.mean(temperature[known]))
    if np.std(temperature[known]) < 1e-6:
        return None, mean
    return np.where(known, temperature - mean, 0.0), mean


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
        return np.asarray(np.sum(w * a * b, axis=1) - np.sum(apart, axis=1))

    criterion = -np.sum(np.log(w), axis=1) + np.sum(np.log(total), axis=1)
    if days.warmth is None:
        return criterion + product(y, y), np.zeros(len(grid)), np.full(len(grid), np.inf)
    square = np.maximum(product(days.warmth, days.warmth), 1e-12)
    cross = product(days.warmth, y)
    criterion = criterion + product(y, y) - cross**2 / square + np.log(square)
    return criterion, cross / square, 1.0 / np.sqrt(square)


_UNKNOWN = 0.05
"""Per K, one sigma, where the fleet does not say: grease loses 5 % of its drag in a kelvin at most."""


def fleet_prior(effects: Sequence[DayEffect]) -> tuple[float, float]:
    """Return mean and sd, per K and relative, of a parameter's temperature slope over the joints of a fleet.

    Random effects by DerSimonian and Laird (1986), never known better than from two joints. Wear beside a
    season that warms would be taken for temperature by one joint alone; the others say how much of it is.
    """
    known = [e for e in effects if np.isfinite(e.per_kelvin_sd) and e.per_kelvin_sd > 0.0]
    if len(known) < 2:
        return 0.0, _UNKNOWN
    value = np.array([e.per_kelvin for e in known])
    variance = np.array([e.per_kelvin_sd**2 for e in known])
    between = _beyond(value, variance, np.zeros(1, int))
    w = 1.0 / (variance + between)
    mean = float(np.sum(w * value) / np.sum(w))
    return mean, float(np.sqrt(between + 1.0 / np.sum(w)))
