"""Trends of a whole fleet, and joints that stand out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.records.statistics import MAD_TO_SD, Z95
from rsea_ros.trends.appearing import adjust, appearances, two_sided_p, with_course
from rsea_ros.trends.cause_series import namings, size_series, temperatures
from rsea_ros.trends.course_search import Tested, change_test, describe
from rsea_ros.trends.days import DayEffect, Days, day_effect, day_means, fleet_prior
from rsea_ros.trends.result import FleetTrends, Outlier, Trend
from rsea_ros.trends.series import (
    DEFAULT,
    RECORDINGS,
    Series,
    Table,
    TrendSettings,
    all_series,
    check_columns,
)
from rsea_ros.trends.trend import trend_of


def outliers(trends: Iterable[Trend], settings: TrendSettings) -> tuple[Outlier, ...]:
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
    q = adjust(np.array([two_sided_p(score, len_ - 1.0) for _, _, score, len_ in scored]))
    return tuple(
        Outlier(t.series.joint, t.series.parameter, t.series.unit, t.now, median, score, float(rate))
        for (t, median, score, _), rate in zip(scored, q, strict=True)
        if t.now is not None and abs(score) >= settings.outlier_joint and rate <= settings.false_discovery
    )


def _score(group: list[Trend]) -> list[tuple[Trend, float, float, int]]:
    levels = np.array([t.now.value for t in group if t.now is not None])
    half = np.array([t.now.high - t.now.low for t in group if t.now is not None]) / (2.0 * Z95)
    median = float(np.median(levels))
    spread = MAD_TO_SD * float(np.median(np.abs(levels - median)))
    scores = (levels - median) / np.sqrt(spread**2 + half**2 + 1e-300)
    return [(t, median, float(s), len(group)) for t, s in zip(group, scores, strict=True)]


Key = tuple[str, str]


def fleet_trends(history: Table, recordings: Table, settings: TrendSettings = DEFAULT) -> FleetTrends:
    """Return the trends of a fleet.

    history: a row for each joint, recording and parameter, columns series.HISTORY; recordings: a row for each
    joint and recording, columns series.RECORDINGS. Raises ParameterError for a table without its columns.
    """
    check_columns(recordings, RECORDINGS, "recordings")
    every, parameters = list(namings(recordings)), list(all_series(history))
    warm = temperatures(history, recordings)
    sized = [s for n in every if n.kind == "cause" and (s := size_series(n, recordings, warm)) is not None]
    trends, priors = _trends([*parameters, *sized], settings)
    of_parameters = {(s.joint, s.parameter): trends[s.joint, s.parameter] for s in parameters}
    of_causes = {(s.joint, s.parameter): trends[s.joint, s.parameter] for s in sized}
    joints = len({n.joint for n in every} | {s.joint for s in parameters})
    return FleetTrends(
        of_parameters,
        of_causes,
        tuple(every),
        tuple(
            with_course(a, of_causes.get((a.joint, f"{a.about}.{a.parameter}")))
            for a in appearances(every, joints, settings)
        ),
        outliers(of_parameters.values(), settings),
        settings.false_discovery,
        sum(t.state != "undetermined" for t in trends.values()),
        priors,
        tuple(sorted({str(j) for j in (*recordings["joint"], *history["joint"])})),
    )


@dataclass(frozen=True)
class _Prepared:
    series: Series
    days: Days
    effect: DayEffect


def _trends(
    all_of: Sequence[Series], settings: TrendSettings
) -> tuple[dict[Key, Trend], dict[str, tuple[float, float]]]:
    """Return the trend of each series, and the temperature slope of each parameter over the fleet."""
    ready, out = [], {}
    for series in all_of:
        days = day_means(series, settings)
        if len(days.t) < settings.fewest_days:
            out[series.joint, series.parameter] = _undetermined_trend(series, len(days.t), settings)
            continue
        ready.append(_Prepared(series, days, day_effect(days, settings)))
    priors = {name: fleet_prior([r.effect for r in group]) for name, group in _by_parameter(ready).items()}
    tests = [change_test(r.days, r.effect, priors[r.series.parameter], settings) for r in ready]
    rates = adjust(np.array([t.p for t in tests]))
    for r, test, q in zip(ready, tests, rates, strict=True):
        out[r.series.joint, r.series.parameter] = _trend(r.series, test, float(q), settings)
    warm = {n: p for n, p in priors.items() if any(r.days.warmth is not None for r in _of(ready, n))}
    return out, warm


def _trend(series: Series, test: Tested, q: float, settings: TrendSettings) -> Trend:
    course = describe(test, settings) if q <= settings.false_discovery else test.course
    return trend_of(series, test, course, q, settings)


def _undetermined_trend(series: Series, days: int, settings: TrendSettings) -> Trend:
    many = len(series.identifiable)
    on = "1 day" if days == 1 else f"{days} days"
    determined = f"{int(np.sum(series.identifiable))} of {many} recordings determine it, on {on}"
    reason = f"{determined}; {settings.fewest_days} days are needed"
    return Trend(series, "undetermined", reason=reason)


def _by_parameter(ready: Iterable[_Prepared]) -> Mapping[str, list[_Prepared]]:
    groups: dict[str, list[_Prepared]] = {}
    for r in ready:
        groups.setdefault(r.series.parameter, []).append(r)
    return groups


def _of(ready: Iterable[_Prepared], parameter: str) -> list[_Prepared]:
    return [r for r in ready if r.series.parameter == parameter]
