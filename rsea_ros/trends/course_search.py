"""The search for the course of a series: is anything but noise, and if so, which steps and ramps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.trends.course import Course, StepOrRamp, cost, course_of, improve
from rsea_ros.trends.day_effect import DayEffect, day_effect
from rsea_ros.trends.days import Days
from rsea_ros.trends.regression import Kind, scan
from rsea_ros.trends.segments import breaks
from rsea_ros.trends.settings import TrendSettings
from rsea_ros.trends.significance import scan_p, scan_threshold

_KINDS: tuple[Kind, ...] = ("step", "ramp")
_MOST_TERMS = 12


@dataclass(frozen=True)
class Tested:
    """A series before anything is looked for: its largest score over all days and kinds, and its p."""

    course: Course
    effect: DayEffect
    prior: tuple[float, float]
    largest: float
    p: float


def change_test(days: Days, effect: DayEffect, prior: tuple[float, float], settings: TrendSettings) -> Tested:
    """Return how surely a series is more than noise."""
    course = course_of(days, effect.variance, prior)
    _, z = _best(course, settings.fewest_beside)
    return Tested(course, effect, prior, z, scan_p(z, _share(days, settings), effect.freedom))


def describe(test: Tested, settings: TrendSettings) -> Course:
    """Return the course of a series that is more than noise: the cheapest of several descriptions.

    Each piece costs the gain that noise alone reaches in one of 1/false_discovery series.
    """
    days = test.course.days
    rate = settings.false_discovery
    price = scan_threshold(rate, _share(days, settings), test.effect.freedom) ** 2
    best = min(_candidates(test.course, price, settings), key=lambda c: cost(c, price))
    days = _at_level(best)
    effect = day_effect(days, settings, best.fit_values())
    anew = replace(course_of(days, effect.variance, test.prior), slope=best.slope, terms=best.terms)
    return _complete(anew, price, settings)


def _at_level(course: Course) -> Days:
    """Return the days with their warmth in proportion to the level: a kelvin makes a share of that."""
    days = course.days
    if days.warmth is None:
        return days
    level = course.regression().coefficients[0] + course.fit_values()
    return replace(days, warmth=days.warmth * np.maximum(level, 0.0))


def _candidates(course: Course, price: float, settings: TrendSettings) -> Iterator[Course]:
    """Yield descriptions by levels, by lines, and by one term after the other."""
    r, few = course.regression(), settings.fewest_beside
    warm = r.x[:, 1:] @ r.coefficients[1:]
    levels = breaks(course.t, r.y - warm, r.w, "level", price, few)
    yield improve(replace(course, terms=_terms(levels, ("step",))), price, few)
    lines = breaks(course.t, r.y - warm, r.w, "line", 1.3 * price, few + 1)
    yield improve(replace(course, slope=True, terms=_terms(lines, _KINDS)), price, few)
    yield _complete(course, price, settings)


def _terms(places: Sequence[int], kinds: tuple[Kind, ...]) -> tuple[StepOrRamp, ...]:
    return tuple(StepOrRamp(kind, i) for i in places[: _MOST_TERMS // len(kinds)] for kind in kinds)


def _complete(course: Course, price: float, settings: TrendSettings) -> Course:
    """Return the course with further terms as long as one is worth its price."""
    few = settings.fewest_beside
    course = improve(course, price, few)
    while len(course.terms) < _MOST_TERMS:
        term, z = _best(course, few)
        if z**2 < price:
            break
        longer = improve(replace(course, terms=(*course.terms, term)), price, few)
        if cost(longer, price) >= cost(course, price):
            break
        course = longer
    return course


def _best(course: Course, fewest: int) -> tuple[StepOrRamp, float]:
    """Return the term that gains most, and its |z|."""
    regression, scores = course.regression(), {}
    for kind in _KINDS:
        z = np.abs(scan(regression, course.t, kind))
        z[:fewest], z[len(z) - fewest + 1 :] = 0.0, 0.0
        scores[kind] = z
    kind = max(_KINDS, key=lambda k: float(np.max(scores[k])))
    index = int(np.argmax(scores[kind]))
    return StepOrRamp(kind, index), float(scores[kind][index])


def _share(days: Days, settings: TrendSettings) -> float:
    return min(0.4, settings.fewest_beside / len(days.t))
