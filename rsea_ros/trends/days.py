"""Recordings of a day become one estimate: their common day effect is one draw, however many they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from rsea_ros.records.normal import MAD_TO_SD
from rsea_ros.records.record import FloatArray
from rsea_ros.trends.series import BoolArray, Series
from rsea_ros.trends.settings import DAY, TrendSettings

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
    scale = _scale(s.value)
    day = np.floor(s.time_s / DAY)
    starts = np.flatnonzero(np.diff(day, prepend=-np.inf))
    y, variance = s.value / scale, np.maximum(s.sd / scale, 1e-9) ** 2
    weight = 1.0 / (variance + _within(y, variance, starts))
    total = np.add.reduceat(weight, starts) if len(starts) else weight
    warmth, mean = _warmth(s.temperature)

    def average(values: FloatArray) -> FloatArray:
        return np.add.reduceat(weight * values, starts) / total if len(starts) else values

    return Days(
        day[starts] + average(s.time_s / DAY - day),
        average(y),
        1.0 / total,
        None if warmth is None else average(warmth),
        mean,
        scale,
    )


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
    far: BoolArray = np.abs(off) > most * np.sqrt(spread**2 + sd**2)
    return far


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
    level: FloatArray = np.median(y - slope[:, None] * t, axis=1)
    return level


def _scale(value: FloatArray) -> float:
    size = float(np.median(np.abs(value))) if len(value) else 0.0
    return size or float(np.max(np.abs(value), initial=0.0)) or 1.0


def _within(y: FloatArray, variance: FloatArray, starts: np.ndarray) -> float:
    """Return the variance of recordings of one day beyond their intervals (DerSimonian and Laird 1986)."""
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
