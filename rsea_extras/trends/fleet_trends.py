"""Trends of a whole fleet in units and dates, from courses in relative units and days, and outliers."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from rsea_extras.trends import course as courses, series as ts
from rsea_extras.trends.appearing import adjust, appearances, scan_threshold
from rsea_extras.trends.course import Course, Dated
from rsea_extras.trends.course_search import Tested, change_test, describe, end_share
from rsea_extras.trends.days import DayEffect, Days, day_effect, day_means, fleet_prior
from rsea_extras.trends.result import Alarm, Change, FleetTrends, Interval, ParameterCourse, State, Trend
from rsea_ros.extension.base import MAD_TO_SD, Z95

_POINTS = 24
"""Places at which a course is drawn, beside its steps."""


def trend_of(
    series: ts.Series, test: Tested, course: Course, q: float, settings: ts.TrendSettings
) -> Trend:
    """Return the trend of a course. course: the one without a change for a series that is noise."""
    scale, whole = course.days.scale, courses.date_course(course, settings.date_doubt)
    detectable = scale * _detectable(course, test.effect.freedom, settings)
    ends = (float(course.t[0]), float(course.t[-1]))
    first, now = (whole.interval(Course.level, t).times(scale) for t in ends)
    level = abs(now.value)
    if detectable > settings.widest * level and not course.terms:
        reason = f"only steps above {detectable / level:.0%} would show" if level else "no level"
        return Trend(series, "undetermined", reason=reason, detectable=detectable)
    changes, slope = tuple(_changes(series, whole)), courses.last_slope(whole)
    goes_on = bool(changes) and changes[-1].kind == "ramp" and courses.is_sure(slope)
    state: State = "trending" if goes_on else "changed" if changes else "steady"
    trend = Trend(
        series, state, q, first, now, slope.times(scale * ts.YEAR), _per_kelvin(course),
        scale * float(np.sqrt(course.day_variance)), detectable, changes, _curve(course), _by_day(course),
    )  # fmt: skip
    return _with_limit(trend, whole, settings) if goes_on else trend


def _per_kelvin(course: Course) -> Interval | None:
    if course.days.warmth is None:
        return None
    r = course.regression()
    return Interval(*(v + course.warm for v in r.combine(np.eye(r.x.shape[1])[1])))


def _detectable(course: Course, freedom: int, settings: ts.TrendSettings) -> float:
    """Return the least step at mid-series that would stand out, relative to the scale."""
    t = course.t
    longer = course.base.with_columns(courses.term("step", t, t[len(t) // 2])[:, None])
    b = scan_threshold(settings.false_discovery, end_share(course.days, settings), freedom)
    return b * float(np.sqrt(longer.covariance[-1, -1]))


def _changes(series: ts.Series, whole: Dated) -> Iterator[Change]:
    """Yield the steps, and the ramps from their beginning; the end of a ramp is not a separate change."""
    course, scale = whole.course, whole.course.days.scale
    if course.slope and courses.is_sure(whole.interval(Course.slope_after, -1)):
        t = float(course.days.t[0]) * ts.DAY
        yield Change("ramp", t, t, t, whole.interval(Course.ramp_size, -1).times(scale), True)
    for i, k in enumerate(course.terms):
        if k.kind == "step":
            yield _change(series, whole, i, whole.interval(Course.step_size, i).times(scale))
        elif courses.is_sure(whole.interval(Course.slope_after, i)):
            yield _change(series, whole, i, whole.interval(Course.ramp_size, i).times(scale))


def _change(series: ts.Series, whole: Dated, i: int, size: Interval) -> Change:
    """Return a change; a step lies between the day that shows it first and the one before."""
    t, k, (first, last) = whole.course.days.t, whole.course.terms[i], whole.ranges[i]
    before = max(0, k.index - 1) if k.kind == "step" else k.index
    since = 0.5 * float(t[before] + t[k.index]) * ts.DAY
    row = int(np.searchsorted(series.time_s, np.floor(t[k.index]) * ts.DAY))
    earliest, latest = float(t[max(0, first - 1)]) * ts.DAY, float(t[last]) * ts.DAY
    return Change(k.kind, since, earliest, latest, size, False, min(row, len(series.time_s) - 1))


def _curve(course: Course) -> ParameterCourse:
    """Return the course at few places: an even grid and both sides of each term's beginning."""
    t, r = course.t, course.regression()
    edges = [v for k in course.terms for v in (t[k.index] - 1e-6, t[k.index])]
    grid = np.unique(np.concatenate([np.linspace(t[0], t[-1], _POINTS), edges]))
    levels = [r.combine(course.level_row(float(at))) for at in grid]
    values = np.array(levels) * course.days.scale
    return ParameterCourse((course.days.t[0] + grid) * ts.DAY, values[:, 0], values[:, 1], values[:, 2])


def _by_day(course: Course) -> ParameterCourse:
    """Return the days' means without the effect of temperature."""
    days, r = course.days, course.regression()
    value = (course.base.y - r.x[:, 1 : course.at] @ r.coefficients[1 : course.at]) * days.scale
    half = Z95 * np.sqrt(days.variance) * days.scale
    return ParameterCourse(days.t * ts.DAY, value, value - half, value + half)


def _with_limit(trend: Trend, whole: Dated, settings: ts.TrendSettings) -> Trend:
    """Return the trend with its limit in the direction of its slope, and the date of reaching it."""
    assert trend.first is not None and trend.per_year is not None
    side = abs(trend.first.value) * settings.limit
    usual = (trend.first.value - side, trend.first.value + side)
    low, high = settings.limits.get(trend.series.parameter, usual)
    limit = high if trend.per_year.value > 0.0 else low
    when = courses.time_to_limit(whole, limit / whole.course.days.scale)
    return replace(trend, limit=limit, to_limit_s=when)


def outliers(trends: Iterable[Trend], settings: ts.TrendSettings) -> tuple[Alarm, ...]:
    """Return the joints whose present level is far from the fleet's median, in spreads of the fleet.

    Spread: median absolute deviation of the others' levels, together with the joint's own doubt.
    """
    groups: dict[tuple[str, str], list[Trend]] = {}
    for trend in trends:
        if trend.now is not None:
            groups.setdefault((trend.series.parameter, trend.series.unit), []).append(trend)
    scored = [s for group in groups.values() if len(group) >= settings.fewest_joints for s in _score(group)]
    if not scored:
        return ()
    scores, counts = np.array([(score, count) for _, _, score, count in scored]).T
    q = adjust(2.0 * student.sf(np.abs(scores), counts - 1.0))  # on either side
    return tuple(
        _outlier(t.series, t.now, median, float(rate))
        for (t, median, score, _), rate in zip(scored, q, strict=True)
        if t.now is not None and abs(score) >= settings.outlier_joint and rate <= settings.false_discovery
    )


def _outlier(s: ts.Series, now: Interval, median: float, q: float) -> Alarm:
    nan, size = float("nan"), Interval(*(v - median for v in now))
    return Alarm(
        f"{s.joint}/{s.parameter}/outlier", s.joint, s.parameter, "outlier", nan, nan, nan, size, s.unit,
        size.value / abs(median) if median else nan, 1.0 - q, "", "",
    )  # fmt: skip


def _score(group: list[Trend]) -> list[tuple[Trend, float, float, int]]:
    levels = np.array([t.now.value for t in group if t.now is not None])
    half = np.array([t.now.high - t.now.low for t in group if t.now is not None]) / (2.0 * Z95)
    median = float(np.median(levels))
    spread = MAD_TO_SD * float(np.median(np.abs(levels - median)))
    scores = (levels - median) / np.sqrt(spread**2 + half**2 + 1e-300)
    return [(t, median, float(s), len(group)) for t, s in zip(group, scores, strict=True)]


Key = tuple[str, str]


def fleet_trends(
    history: ts.Table, recordings: ts.Table, settings: ts.TrendSettings = ts.DEFAULT
) -> FleetTrends:
    """Return the trends of a fleet.

    history: a row for each joint, recording and parameter, columns series.HISTORY; recordings: a row for each
    joint and recording, columns series.RECORDINGS, faults and causes as in the store's rows.
    Raises ParameterError for a table without its columns.
    """
    every, parameters = list(ts.namings(recordings)), list(ts.all_series(history))
    sized = list(ts.cause_sizes(every, history, recordings))
    trends, priors = _trends([*parameters, *sized], settings)
    of_parameters = {(s.joint, s.parameter): trends[s.joint, s.parameter] for s in parameters}
    of_causes = {(s.joint, s.parameter): trends[s.joint, s.parameter] for s in sized}
    joints = len({n.joint for n in every} | {s.joint for s in parameters})
    new = tuple(appearances(every, joints, recordings, of_causes, settings))
    unlike = outliers(of_parameters.values(), settings)
    tests = sum(t.state != "undetermined" for t in trends.values())
    names = tuple(sorted({str(j) for j in (*recordings["joint"], *history["joint"])}))
    rate = settings.false_discovery
    return FleetTrends(of_parameters, of_causes, tuple(every), new, unlike, rate, tests, priors, names)


def _trends(
    all_of: Sequence[ts.Series], settings: ts.TrendSettings
) -> tuple[dict[Key, Trend], dict[str, tuple[float, float]]]:
    """Return the trend of each series, and the temperature slope of each parameter over the fleet."""
    out: dict[Key, Trend] = {}
    ready: list[tuple[ts.Series, Days, DayEffect]] = []
    effects: dict[str, list[DayEffect]] = {}
    for series in all_of:
        days = day_means(series, settings)
        if len(days.t) < settings.fewest_days:
            determined = f"{int(np.sum(series.identifiable))} of {len(series.identifiable)} recordings"
            on = "1 day" if len(days.t) == 1 else f"{len(days.t)} days"
            reason = f"{determined} determine it, on {on}; {settings.fewest_days} days are needed"
            out[series.joint, series.parameter] = Trend(series, "undetermined", reason=reason)
            continue
        ready.append((series, days, day_effect(days, settings)))
        effects.setdefault(series.parameter, []).append(ready[-1][2])
    priors = {name: fleet_prior(group) for name, group in effects.items()}
    tests = [change_test(days, effect, priors[s.parameter], settings) for s, days, effect in ready]
    rates = adjust(np.array([t.p for t in tests]))
    for (s, _, _), test, q in zip(ready, tests, rates, strict=True):
        course = describe(test, settings) if q <= settings.false_discovery else test.course
        out[s.joint, s.parameter] = trend_of(s, test, course, float(q), settings)
    warm = {s.parameter for s, days, _ in ready if days.warmth is not None}
    return out, {n: p for n, p in priors.items() if n in warm}
