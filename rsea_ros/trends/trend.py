"""From a course in relative units and days to a trend in the parameter's unit and in dates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rsea_ros.records.statistics import Z95
from rsea_ros.trends.appearing import scan_threshold
from rsea_ros.trends.course import Course, term
from rsea_ros.trends.course_search import Tested
from rsea_ros.trends.quantities import (
    Dated,
    combine,
    date_course,
    is_sure,
    last_slope,
    level_at,
    level_row,
    ramp_size,
    slope_after,
    step_size,
    time_to_limit,
)
from rsea_ros.trends.result import Change, Interval, ParameterCourse, Trend
from rsea_ros.trends.series import DAY, YEAR, Series, TrendSettings

_POINTS = 24
"""Places at which a course is drawn, beside its steps."""


def trend_of(series: Series, test: Tested, course: Course, q: float, settings: TrendSettings) -> Trend:
    """Return the trend of a course. course: the one without a change for a series that is noise."""
    scale, whole = course.days.scale, date_course(course, settings.date_doubt)
    detectable = scale * _detectable(course, test.effect.freedom, settings)
    first, now = (whole.interval(level_at(float(t))).times(scale) for t in (course.t[0], course.t[-1]))
    level = abs(now.value)
    if detectable > settings.widest * level and not course.terms:
        reason = f"only steps above {detectable / level:.0%} would show" if level else "no level"
        return Trend(series, "undetermined", reason=reason, detectable=detectable)
    changes, slope = tuple(_changes(series, whole)), last_slope(whole)
    goes_on = bool(changes) and changes[-1].kind == "ramp" and is_sure(slope)
    trend = Trend(
        series,
        "trending" if goes_on else "changed" if changes else "steady",
        q,
        first,
        now,
        per_year=slope.times(scale * YEAR),
        day_sd=scale * float(np.sqrt(course.day_variance)),
        detectable=detectable,
        changes=changes,
        curve=_curve(course),
        by_day=_by_day(course),
        per_kelvin=_per_kelvin(course),
    )
    return _with_limit(trend, whole, settings) if goes_on else trend


def _per_kelvin(course: Course) -> Interval | None:
    if course.days.warmth is None:
        return None
    r = course.regression()
    row = np.zeros(r.x.shape[1])
    row[1] = 1.0
    return Interval(*(v + course.warm for v in combine(r, row)))


def _detectable(course: Course, freedom: int, settings: TrendSettings) -> float:
    """Return the least step at mid-series that would stand out, relative to the scale."""
    t, n = course.t, len(course.t)
    longer = course.base.with_columns(term("step", t, t[n // 2])[:, None])
    share = min(0.4, settings.fewest_beside / n)
    b = scan_threshold(settings.false_discovery, share, freedom)
    return b * float(np.sqrt(longer.covariance[-1, -1]))


def _changes(series: Series, whole: Dated) -> Iterator[Change]:
    """Yield the steps, and the ramps from their beginning; the end of a ramp is not a separate change."""
    course, scale = whole.course, whole.course.days.scale
    if course.slope and is_sure(whole.interval(slope_after(-1))):
        t = float(course.days.t[0]) * DAY
        yield Change("ramp", t, t, t, whole.interval(ramp_size(-1)).times(scale), True)
    for i, k in enumerate(course.terms):
        if k.kind == "step":
            yield _change(series, whole, i, whole.interval(step_size(i)).times(scale))
        elif is_sure(whole.interval(slope_after(i))):
            yield _change(series, whole, i, whole.interval(ramp_size(i)).times(scale))


def _change(series: Series, whole: Dated, i: int, size: Interval) -> Change:
    """Return a change; a step lies between the day that shows it first and the one before."""
    t, k, (first, last) = whole.course.days.t, whole.course.terms[i], whole.ranges[i]
    before = max(0, k.index - 1) if k.kind == "step" else k.index
    since = 0.5 * float(t[before] + t[k.index]) * DAY
    row = int(np.searchsorted(series.time_s, np.floor(t[k.index]) * DAY))
    earliest, latest = float(t[max(0, first - 1)]) * DAY, float(t[last]) * DAY
    return Change(k.kind, since, earliest, latest, size, False, min(row, len(series.time_s) - 1))


def _curve(course: Course) -> ParameterCourse:
    """Return the course at few places: an even grid and both sides of each term's beginning."""
    t, r = course.t, course.regression()
    edges = [v for k in course.terms for v in (t[k.index] - 1e-6, t[k.index])]
    grid = np.unique(np.concatenate([np.linspace(t[0], t[-1], _POINTS), edges]))
    values = np.array([combine(r, level_row(course, float(at))) for at in grid]) * course.days.scale
    return ParameterCourse((course.days.t[0] + grid) * DAY, values[:, 0], values[:, 1], values[:, 2])


def _by_day(course: Course) -> ParameterCourse:
    days, value = course.days, course.at_mean_temperature() * course.days.scale
    half = Z95 * np.sqrt(days.variance) * days.scale
    return ParameterCourse(days.t * DAY, value, value - half, value + half)


def _with_limit(trend: Trend, whole: Dated, settings: TrendSettings) -> Trend:
    """Return the trend with its limit in the direction of its slope, and the date of reaching it."""
    assert trend.first is not None and trend.per_year is not None
    side = abs(trend.first.value) * settings.limit
    usual = (trend.first.value - side, trend.first.value + side)
    low, high = settings.limits.get(trend.series.parameter, usual)
    limit = high if trend.per_year.value > 0.0 else low
    when = time_to_limit(whole, limit / whole.course.days.scale)
    return replace(trend, limit=limit, to_limit_s=when)
