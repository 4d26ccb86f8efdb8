"""The search for the course of a series: is anything but noise, and if so, which steps and ramps.

Where the days fall into pieces: optimal partitioning, with the days weighted by their doubt (Jackson et al.,
2005, An algorithm for optimal partitioning of data on an interval).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rsea_extras.trends.appearing import scan_p, scan_threshold
from rsea_extras.trends.course import Course, Kind, StepOrRamp, allowed_gains, cost, course_of, improve, scan
from rsea_extras.trends.days import DayEffect, Days, day_effect
from rsea_extras.trends.series import TrendSettings
from rsea_ros.extension.base import FloatArray

_KINDS: tuple[Kind, ...] = ("step", "ramp")
_MOST_TERMS = 12


@dataclass(frozen=True)
class Tested:
    """A series without a change, and the p of its largest score over all days and kinds.

    effect: the day effect without a change. beside: the one beside the step or ramp of that score.
    """

    course: Course
    effect: DayEffect
    beside: DayEffect
    prior: tuple[float, float]
    p: float


def change_test(days: Days, effect: DayEffect, prior: tuple[float, float], settings: TrendSettings) -> Tested:
    """Return how surely a series is more than noise.

    The day effect counts beside the step or ramp that is tested (Student's t, the largest of all days).
    In a series of few days a step inside a block would hide in the scatter that it makes.
    """
    course = course_of(days, effect.variance, prior)
    best, _ = _best(course, settings.fewest_beside)
    beside = _effect_beside(course, best, settings)
    anew = course_of(days, beside.variance, prior)
    z = float(abs(scan(anew.regression(), anew.t, best.kind)[best.index]))
    return Tested(course, effect, beside, prior, scan_p(z, end_share(days, settings), beside.freedom))


def _effect_beside(course: Course, change: StepOrRamp, settings: TrendSettings) -> DayEffect:
    """Return the day effect beside a step or ramp, whose size takes one degree of freedom."""
    changed = replace(course, terms=(change,))
    effect = day_effect(course.days, settings, changed.fit_values())
    freedom = max(1, effect.freedom - 1)
    return replace(effect, variance=effect.variance * effect.freedom / freedom, freedom=freedom)


def describe(test: Tested, settings: TrendSettings) -> Course:
    """Return the course of a series that is more than noise: the cheapest of several descriptions.

    Each piece costs the gain that noise alone reaches in one of 1/false_discovery series.
    """
    days = test.course.days
    rate = settings.false_discovery
    price = scan_threshold(rate, end_share(days, settings), test.beside.freedom) ** 2
    course = course_of(days, test.beside.variance, test.prior)
    best = min(_candidates(course, price, settings), key=lambda c: cost(c, price))
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
    regression = course.regression()
    scores = {k: allowed_gains(np.abs(scan(regression, course.t, k)), (), fewest) for k in _KINDS}
    kind = max(_KINDS, key=lambda k: float(np.max(scores[k])))
    index = int(np.argmax(scores[kind]))
    return StepOrRamp(kind, index), float(scores[kind][index])


def end_share(days: Days, settings: TrendSettings) -> float:
    """Return the share of the days at each end where no change is looked for."""
    return min(0.4, settings.fewest_beside / len(days.t))


Piece = Literal["level", "line"]
"""What a piece is: a level, or a level with a slope."""
_MOST = 80
"""Places that are tried; the days between are looked at afterwards (course.py)."""


def breaks(
    t: FloatArray, y: FloatArray, w: FloatArray, piece: Piece, price: float, fewest: int
) -> Sequence[int]:
    """Return the first index of each piece but the first. price: of a piece, in twice log likelihood.

    The weights whiten: each is 1 over the variance of its day, interval and day effect together.
    """
    n = len(t)
    places = np.array([*range(0, n, -(-n // _MOST)), n])
    t = t - t.mean()
    columns = np.stack([w, w * y, w * y * y, w * t, w * t * t, w * t * y])
    sums = np.concatenate([np.zeros((6, 1)), np.cumsum(columns, axis=1)], axis=1)[:, places]
    least, before = np.full(len(places), np.inf), np.zeros(len(places), int)
    least[0] = 0.0
    for end in range(1, len(places)):
        starts = np.flatnonzero((places[end] - places >= fewest) & np.isfinite(least))
        if len(starts):
            costs = least[starts] + _cost(sums[:, end, None] - sums[:, starts], piece) + price
            least[end], before[end] = costs.min(), starts[np.argmin(costs)]
    found, end = [], int(before[-1])
    while end:
        found.append(int(places[end]))
        end = int(before[end])
    return found[::-1]


def _cost(sums: FloatArray, piece: Piece) -> FloatArray:
    """Return the weighted sums of squares about the level or line of pieces, from their sums."""
    w, wy, wyy, wt, wtt, wty = sums
    cost: FloatArray = wyy - wy * wy / w
    if piece == "level":
        return cost
    spread = wtt - wt * wt / w
    is_line = spread > 1e-12 * wtt
    return np.where(is_line, cost - (wty - wt * wy / w) ** 2 / np.where(is_line, spread, 1.0), cost)
