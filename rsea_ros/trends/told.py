"""From a course in relative units to levels, slopes, changes and times in the parameter's unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.signals import FloatArray
from rsea_ros.trends.course import Course, Term, date_range
from rsea_ros.trends.regression import Kind, Regression, term
from rsea_ros.trends.result import Change, Curve, Interval, Trend
from rsea_ros.trends.search import Tested
from rsea_ros.trends.series import Series
from rsea_ros.trends.settings import DAY, YEAR, TrendSettings
from rsea_ros.trends.significance import scan_threshold

_Z = 1.959964
_POINTS = 200
_SURE_SLOPE = 3.0
"""|z| of the last piece's slope from which it is a trend: one in 370, of a series that is more than noise."""


def trend_of(series: Series, test: Tested, course: Course, q: float, settings: TrendSettings) -> Trend:
    """Return what a course says. course: the one without a change for a series that is noise."""
    scale, days = course.days.scale, course.days
    r = course.regression()
    detectable = scale * _detectable(course, test.effect.freedom, settings)
    first, now = (combined(r, _row(course, float(t))).times(scale) for t in (course.t[0], course.t[-1]))
    slope, sure = _slope(course)
    level = abs(now.value)
    if detectable > settings.widest * level and not course.terms:
        reason = f"only steps above {detectable / level:.0%} would show" if level else "no level"
        return Trend(series, "untold", len(days.t), reason=reason, detectable=detectable)
    changes = tuple(_changes(series, course, r, settings))
    trend = Trend(
        series,
        "trending" if sure else "changed" if changes else "steady",
        len(days.t),
        q,
        first,
        now,
        per_year=slope.times(scale * YEAR),
        day_sd=scale * float(np.sqrt(course.day_variance)),
        detectable=detectable,
        changes=changes,
        curve=_curve(course, r),
        by_day=_by_day(course),
        per_kelvin=_per_kelvin(course, r),
    )
    return _with_limit(trend, course, settings) if sure else trend


def combined(r: Regression, row: FloatArray) -> Interval:
    """Return a linear combination of the coefficients with its interval."""
    variance = float(row @ r.covariance @ row)
    value, half = float(row @ r.coefficients), _Z * float(np.sqrt(max(0.0, variance)))
    return Interval(value, value - half, value + half)


def _per_kelvin(course: Course, r: Regression) -> Interval | None:
    if course.days.warmth is None:
        return None
    row = np.zeros(r.x.shape[1])
    row[1] = 1.0
    return Interval(*(v + course.warm for v in combined(r, row)))


def _row(course: Course, t: float) -> FloatArray:
    """Return the regressors of the course at a time, at the mean temperature."""
    at = np.array([t])
    terms = [float(term(k.kind, at, course.t[k.index])[0]) for k in course.terms]
    return np.array([1.0, *[0.0] * (course.at - 1), *([t] if course.slope else []), *terms])


def _slopes(course: Course, after: float) -> FloatArray:
    """Return the combination of coefficients that is the slope just after a time, per day."""
    row = np.zeros(course.at + course.slope + len(course.terms))
    if course.slope:
        row[course.at] = 1.0
    for i, k in enumerate(course.terms):
        if k.kind == "ramp" and course.t[k.index] <= after:
            row[course.at + course.slope + i] = 1.0
    return row


def _slope(course: Course) -> tuple[Interval, bool]:
    """Return the slope of the last piece, per day and relative, and whether it is a trend."""
    r, row = course.regression(), _slopes(course, course.t[-1])
    if np.any(row):
        slope = combined(r, row)
        return slope, abs(slope.value) > _SURE_SLOPE / _Z * (slope.value - slope.low)
    start = max([k.index for k in course.terms], default=0)
    if len(course.t) - start < 3 or course.t[-1] <= course.t[start]:
        return Interval(0.0, -np.inf, np.inf), False
    longer = replace(course, terms=(*course.terms, Term("ramp", start)))
    row = np.zeros(r.x.shape[1] + 1)
    row[-1] = 1.0
    return combined(longer.regression(), row), False


def _detectable(course: Course, freedom: int, settings: TrendSettings) -> float:
    """Return the least step at mid-series that would stand out, relative to the scale."""
    t, n = course.t, len(course.t)
    longer = course.base.with_columns(term("step", t, t[n // 2])[:, None])
    share = min(0.4, settings.fewest_beside / n)
    b = scan_threshold(settings.false_discovery, share, freedom)
    return b * float(np.sqrt(longer.covariance[-1, -1]))


def _changes(series: Series, course: Course, r: Regression, settings: TrendSettings) -> list[Change]:
    """Return the steps, and the ramps from where they begin; the end of a ramp is no change of its own."""
    changes, t = [], course.t
    if course.slope:
        changes.append(_ramp(series, course, r, 0, (0, 0), True))
    for i, k in enumerate(course.terms):
        where = date_range(course, i, settings.date_doubt)
        if k.kind == "step":
            row = np.zeros(r.x.shape[1])
            row[course.at + course.slope + i] = 1.0
            size = combined(r, row).times(course.days.scale)
            changes.append(_change(series, course, "step", k.index, where, size))
            continue
        slope = combined(r, _slopes(course, t[k.index]))
        if slope.low > 0.0 or slope.high < 0.0:
            changes.append(_ramp(series, course, r, k.index, where, False))
    return changes


def _ramp(
    series: Series, course: Course, r: Regression, index: int, where: tuple[int, int], is_open: bool
) -> Change:
    t = course.t
    later = [t[k.index] for k in course.terms if k.kind == "ramp" and k.index > index]
    length = min([*later, t[-1]]) - t[index]
    size = combined(r, _slopes(course, t[index])).times(course.days.scale * length)
    return _change(series, course, "ramp", index, where, size, is_open)


def _change(
    series: Series, course: Course, kind: Kind, index: int, where: tuple[int, int], size: Interval,
    is_open: bool = False,
) -> Change:  # fmt: skip
    """Return a change dated between the day that shows it first and the one before."""
    t = course.days.t
    before = max(0, index - 1) if kind == "step" else index
    since = 0.5 * (t[before] + t[index]) * DAY
    earliest, latest = t[max(0, where[0] - 1)] * DAY, t[where[1]] * DAY
    row = int(np.searchsorted(series.time_s, np.floor(t[index]) * DAY))
    return Change(kind, since, earliest, latest, size, is_open, min(row, len(series.time_s) - 1))


def _curve(course: Course, r: Regression) -> Curve:
    """Return the course at few places: an even grid and both sides of each step."""
    t = course.t
    edges = [v for k in course.terms for v in (t[k.index] - 1e-6, t[k.index])]
    grid = np.unique(np.concatenate([np.linspace(t[0], t[-1], min(_POINTS, 24)), edges]))
    values = np.array([combined(r, _row(course, at)) for at in grid]) * course.days.scale
    return Curve((course.days.t[0] + grid) * DAY, values[:, 0], values[:, 1], values[:, 2])


def _by_day(course: Course) -> Curve:
    days, value = course.days, course.at_mean_temperature() * course.days.scale
    half = _Z * np.sqrt(days.variance) * days.scale
    return Curve(days.t * DAY, value, value - half, value + half)


def _with_limit(trend: Trend, course: Course, settings: TrendSettings) -> Trend:
    """Return the trend with the time at which it meets its limit, if it goes there (Fieller 1954)."""
    assert trend.now is not None and trend.first is not None and trend.per_year is not None
    up = trend.per_year.value > 0.0
    side = abs(trend.first.value) * settings.limit
    low, high = settings.limits.get(
        trend.series.parameter, (trend.first.value - side, trend.first.value + side)
    )
    limit = high if up else low
    r, t = course.regression(), course.t
    a, b = _row(course, t[-1]), _slopes(course, t[-1])
    target = limit / course.days.scale
    level, slope = float(a @ r.coefficients) - target, float(b @ r.coefficients)
    c = r.covariance
    square = slope**2 - _Z**2 * float(b @ c @ b)
    half = level * slope - _Z**2 * float(a @ c @ b)
    rest = level**2 - _Z**2 * float(a @ c @ a)
    room = half**2 - square * rest
    if square <= 0.0 or room < 0.0 or level * slope > 0.0:
        return replace(trend, limit=limit)
    ends = sorted((-half + s * np.sqrt(room)) / square for s in (-1.0, 1.0))
    dates = [(course.days.t[-1] + d) * DAY for d in (-level / slope, *ends)]
    return replace(trend, limit=limit, to_limit_s=Interval(*dates))
