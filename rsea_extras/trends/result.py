"""The trend of a joint's parameter over time as values, for pages and alarms; means by week for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from rsea_extras.trends.series import DAY, BoolArray, Naming, Series
from rsea_ros.extension.base import Z95, FloatArray

State = Literal["steady", "changed", "trending", "undetermined"]
"""undetermined: the recordings do not excite the parameter enough to say anything of its course."""
Growth = Literal["", "growing", "shrinking"]
"""Of the size of a cause; empty where it is steady or unknown."""
_MANY, _LONG = 10, 28 * DAY
"""Recordings, and s, that make silence."""


class Interval(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    def times(self, factor: float) -> Interval:
        """Return the interval in another unit."""
        ends = sorted((self.low * factor, self.high * factor))
        return Interval(float(self.value * factor), float(ends[0]), float(ends[1]))


@dataclass(frozen=True)
class Change:
    """A step, or a ramp, which changes by `size` from `since_s` until it ends or the recordings do.

    since_s: POSIX s, with the earliest and the latest at which it may have begun. size: in the parameter's
    unit. open_start: it began before the first recording. recording: place of the first row that shows it.
    """

    kind: Literal["step", "ramp"]
    since_s: float
    earliest_s: float
    latest_s: float
    size: Interval
    open_start: bool = False
    row: int = 0


@dataclass(frozen=True)
class ParameterCourse:
    """The course of the parameter without temperature and day effects: POSIX s, its unit; each shape (n,)."""

    time_s: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class Trend:
    """A series and its course. All values in the parameter's unit.

    first, now: level at the first and the last day, at the mean temperature. per_year: slope of the last
    piece. per_kelvin: of the temperature, relative to the level, per K; None where it is not logged. day_sd:
    of the day effect. detectable: the least step in mid-series that these recordings would show. q: false
    discovery rate at which the series is more than noise. by_day: means of the days at the mean temperature,
    with the recordings' own intervals. to_limit_s: POSIX s at which `limit` is reached.
    reason: of a series that is undetermined.
    """

    series: Series
    state: State
    q: float = 1.0
    first: Interval | None = None
    now: Interval | None = None
    per_year: Interval | None = None
    per_kelvin: Interval | None = None
    day_sd: float = 0.0
    detectable: float = float("nan")
    changes: tuple[Change, ...] = ()
    curve: ParameterCourse | None = None
    by_day: ParameterCourse | None = None
    limit: float = float("nan")
    to_limit_s: Interval | None = None
    reason: str = ""

    @property
    def silent_since_s(self) -> float:
        """Return since when many recordings could not determine the parameter, POSIX s; NaN if they can."""
        determined = self.series.time_s[self.series.identifiable]
        last = float(determined[-1]) if len(determined) else -np.inf
        later = self.series.time_s[self.series.time_s > last]
        long = len(later) >= _MANY and float(later[-1]) - last > _LONG
        return last if long and np.isfinite(last) else float("nan")

    @property
    def relative(self) -> float:
        """Return the change from the first level to the last, relative to the first, or NaN."""
        if self.first is None or self.now is None or not self.first.value:
            return float("nan")
        return self.now.value / self.first.value - 1.0


Kind = Literal["change", "trend", "outlier", "cause", "fault"]


@dataclass(frozen=True)
class Alarm:
    """A finding of a joint.

    key: the same at every look at a growing history while the finding lasts. about: parameter,
    cause or fault. since_s: POSIX s, with earliest_s and latest_s; NaN for an outlier. size: in `unit`,
    change from before or the cause's size now, with its 95 % interval; None for a fault. relative: size over
    the level before, NaN where none. confidence: 1 less the false discovery rate. recording, artefacts: of
    the first recording that shows it. share: of the days since then that name a cause or a fault.
    from_first: the first recording shows it, so since_s is the latest at which it may have begun. growth: of
    a cause's size. status: of a cause, as most of its diagnoses state it; `one_of`: the data do not
    distinguish it from another.
    """

    key: str
    joint: str
    about: str
    kind: Kind
    since_s: float
    earliest_s: float
    latest_s: float
    size: Interval | None
    unit: str
    relative: float
    confidence: float
    recording: str
    artefacts: str
    share: float = 1.0
    from_first: bool = False
    growth: Growth = ""
    status: str = ""


@dataclass(frozen=True)
class FleetTrends:
    """All that is known of a fleet's course.

    trends: by joint and parameter, in the order of the history. sizes: of causes by joint and
    `cause.parameter`, from the recordings that name them. namings: which recordings name a cause or a fault.
    appearances: causes and faults that a joint has from some day on, or unlike its fleet from the first.
    outliers: joints whose parameter is unlike that of the others.
    false_discovery: rate that the findings keep, over `tests` tests. per_kelvin: mean and sd of each
    parameter's temperature slope over the joints, relative. joints: every joint that has a recording,
    by name, also where no recording has a date or a result.
    """

    trends: Mapping[tuple[str, str], Trend]
    sizes: Mapping[tuple[str, str], Trend]
    namings: tuple[Naming, ...]
    appearances: tuple[Alarm, ...]
    outliers: tuple[Alarm, ...]
    false_discovery: float
    tests: int
    per_kelvin: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    joints: tuple[str, ...] = ()


_WEEK, _SHORT, _MOST = 7.0, 70.0, 110
"""Days of a week; days up to which a step is a day; steps of a picture: more are no longer distinguished."""


@dataclass(frozen=True)
class Steps:
    """Equal steps of time. edges: POSIX s, shape (n + 1,)."""

    edges: FloatArray

    @property
    def days(self) -> float:
        return float(self.edges[1] - self.edges[0]) / DAY

    @property
    def name(self) -> str:
        weeks = round(self.days / _WEEK)
        return "day" if self.days < _WEEK else "week" if weeks == 1 else f"{weeks} weeks"

    @property
    def middle(self) -> FloatArray:
        """Return the middle of each step, POSIX s, shape (n,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    def __len__(self) -> int:
        return len(self.edges) - 1

    def place(self, time_s: FloatArray) -> np.ndarray:
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
