"""Series in weeks, or in longer steps where they are long, for pictures of thousands of recordings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.trends.result import Trend
from rsea_ros.trends.series import DAY, BoolArray

_WEEK, _SHORT, _MOST = 7.0, 70.0, 110
"""Days of a week; days up to which a step is a day; steps of a picture: more are no longer distinguished."""


@dataclass(frozen=True)
class Steps:
    """Equal steps of time. edges: POSIX s, shape (n + 1,)."""

    edges: FloatArray

    @property
    def days(self) -> float:
        """Return how long a step is."""
        return float(self.edges[1] - self.edges[0]) / DAY

    @property
    def name(self) -> str:
        """Return the name of a step."""
        weeks = round(self.days / _WEEK)
        return "day" if self.days < _WEEK else "week" if weeks == 1 else f"{weeks} weeks"

    @property
    def middle(self) -> FloatArray:
        """Return the middle of each step, POSIX s, shape (n,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    def __len__(self) -> int:
        return len(self.edges) - 1

    def place(self, time_s: FloatArray) -> np.ndarray:
        """Return the step that each time lies in."""
        places = np.searchsorted(self.edges, time_s, side="right") - 1
        return np.clip(places, 0, len(self) - 1)

    def count(self, time_s: FloatArray) -> np.ndarray:
        """Return how many times lie in each step, shape (n,)."""
        return np.bincount(self.place(time_s), minlength=len(self))


@dataclass(frozen=True)
class Binned:
    """Means of a parameter by step, NaN where no recording determines it, each shape (n,).

    low, high: 95 % interval, day effects included. identifiable, recorded: recordings that determine it, and
    all of them.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray
    identifiable: np.ndarray
    recorded: np.ndarray


def steps_over(first_s: float, last_s: float) -> Steps:
    """Return steps that hold both times: days of a short history, else whole weeks from Monday on."""
    day = np.floor(first_s / DAY)
    if last_s / DAY - day < _SHORT:
        return Steps((day + np.arange(int(np.floor(last_s / DAY) - day) + 2)) * DAY)
    monday = day - (day + 3.0) % _WEEK
    weeks = max(1, int(np.floor((last_s / DAY - monday) / _WEEK)) + 1)
    length = -(-weeks // _MOST)
    count = -(-weeks // length)
    return Steps((monday + _WEEK * length * np.arange(count + 1)) * DAY)


def bin_days(trend: Trend, steps: Steps) -> Binned:
    """Return a trend's days at the mean temperature, averaged by step with their weights."""
    s, n = trend.series, len(steps)
    identifiable, recorded = steps.count(s.time_s[s.identifiable]), steps.count(s.time_s)
    empty = np.full(n, np.nan)
    if trend.by_day is None or not len(trend.by_day.time_s):
        return Binned(empty, empty, empty, identifiable, recorded)
    d, place = trend.by_day, steps.place(trend.by_day.time_s)
    w = 1.0 / (((d.high - d.low) / (2.0 * Z95)) ** 2 + trend.day_sd**2)
    total = np.bincount(place, w, n)
    some: BoolArray = total > 0.0
    safe = np.where(some, total, 1.0)
    value = np.where(some, np.bincount(place, w * d.value, n) / safe, np.nan)
    half = np.where(some, Z95 / np.sqrt(safe), np.nan)
    return Binned(value, value - half, value + half, identifiable, recorded)
