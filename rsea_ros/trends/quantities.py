"""Quantities with a trend, and the time until one reaches its limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.trends.course import Course, Regression, StepOrRamp, date_range, term
from rsea_ros.trends.result import Interval
from rsea_ros.trends.series import DAY

_SURE_SLOPE = 3.0
"""|z| of a slope from which it is a trend: one in 370, of a series that is more than noise."""
Quantity = Callable[[Course], Interval]


@dataclass(frozen=True)
class Dated:
    """A course, the days on which its terms may begin, and it with each term at both ends of these."""

    course: Course
    ranges: tuple[tuple[int, int], ...]
    moved: tuple[tuple[Course, Course], ...]

    def interval(self, of: Quantity) -> Interval:
        """Return a quantity of the course; its interval spans the dates too, in quadrature."""
        best = of(self.course)
        apart = [[of(c).value - best.value for c in pair] for pair in self.moved]
        below = np.sqrt((best.value - best.low) ** 2 + sum(min(0.0, *pair) ** 2 for pair in apart))
        above = np.sqrt((best.high - best.value) ** 2 + sum(max(0.0, *pair) ** 2 for pair in apart))
        return Interval(best.value, best.value - float(below), best.value + float(above))


def date_course(course: Course, doubt: float) -> Dated:
    """Return a course with the ranges of its dates. doubt: fall of twice the log likelihood."""
    ranges = tuple(date_range(course, i, doubt) for i in range(len(course.terms)))
    moved = tuple(
        (_move(course, i, first), _move(course, i, last)) for i, (first, last) in enumerate(ranges)
    )
    return Dated(course, ranges, moved)


def _move(course: Course, i: int, index: int) -> Course:
    terms: Sequence[StepOrRamp] = course.terms
    return replace(course, terms=(*terms[:i], replace(terms[i], index=index), *terms[i + 1 :]))


def combine(r: Regression, row: FloatArray) -> Interval:
    """Return a linear combination of the coefficients with its interval."""
    variance = float(row @ r.covariance @ row)
    value, half = float(row @ r.coefficients), Z95 * float(np.sqrt(max(0.0, variance)))
    return Interval(value, value - half, value + half)


def level_at(t: float) -> Quantity:
    """Return the quantity that is the level at a time, at the mean temperature. t: days from the first on."""
    return lambda course: combine(course.regression(), level_row(course, t))


def level_row(course: Course, t: float) -> FloatArray:
    """Return the combination of coefficients that is the level at a time."""
    at = np.array([t])
    terms = [float(term(k.kind, at, course.t[k.index])[0]) for k in course.terms]
    return np.array([1.0, *[0.0] * (course.at - 1), *([t] if course.slope else []), *terms])


def slope_row(course: Course, last: int) -> FloatArray:
    """Return the combination of coefficients that is the slope after the ramps up to a term's place."""
    row = np.zeros(course.at + course.slope + len(course.terms))
    row[course.at : course.at + course.slope] = 1.0
    for i, k in enumerate(course.terms[: last + 1]):
        row[course.at + course.slope + i] = float(k.kind == "ramp")
    return row


def slope_after(last: int) -> Quantity:
    """Return the quantity that is the slope, per day, after the ramps up to a place; -1: before all."""
    return lambda course: combine(course.regression(), slope_row(course, last))


def step_size(i: int) -> Quantity:
    """Return the quantity that is the size of the step at a term's place."""

    def size(course: Course) -> Interval:
        row = np.zeros(course.at + course.slope + len(course.terms))
        row[course.at + course.slope + i] = 1.0
        return combine(course.regression(), row)

    return size


def ramp_size(last: int) -> Quantity:
    """Return the change that a ramp adds until the next one or the end; -1: the first slope."""

    def size(course: Course) -> Interval:
        begin = course.t[course.terms[last].index] if last >= 0 else 0.0
        later = [course.t[k.index] for k in course.terms[last + 1 :] if k.kind == "ramp"]
        length = float(min([*later, course.t[-1]]) - begin)
        return slope_after(last)(course).times(length)

    return size


def last_slope(whole: Dated) -> Interval:
    """Return the slope of the last piece, per day, also where it is not part of the course."""
    course = whole.course
    if course.slope or any(k.kind == "ramp" for k in course.terms):
        return whole.interval(slope_after(len(course.terms) - 1))
    start = max((k.index for k in course.terms), default=0)
    if len(course.t) - start < 3 or course.t[-1] <= course.t[start]:
        return Interval(0.0, -np.inf, np.inf)
    longer = replace(course, terms=(*course.terms, StepOrRamp("ramp", start)))
    return step_size(len(course.terms))(longer)


def is_sure(slope: Interval) -> bool:
    """Return whether a slope is surely none of noise."""
    near = slope.value - slope.low if slope.value > 0.0 else slope.high - slope.value
    return abs(slope.value) > _SURE_SLOPE / Z95 * near


def time_to_limit(whole: Dated, limit: float) -> Interval | None:
    """Return POSIX s at which the last slope brings the level to a limit; None where it surely does not.

    limit: in units of the scale. The ratio of two normal values has the interval of Fieller (1954); the
    doubt of the dates of the terms comes on top.
    """
    if _ahead(whole.course, limit) is None:
        return None
    parts = [_ahead(c, limit) for pair in whole.moved for c in pair]
    if any(p is None for p in parts):
        return None
    days = whole.interval(lambda course: _ahead(course, limit) or Interval(0.0, 0.0, 0.0))
    last = whole.course.days.t[-1]
    return Interval(*(float(last + d) * DAY for d in days))


def _ahead(course: Course, limit: float) -> Interval | None:
    """Return days from the last one on."""
    r, c = course.regression(), course.regression().covariance
    a, b = level_row(course, float(course.t[-1])), slope_row(course, len(course.terms) - 1)
    level, slope = float(a @ r.coefficients) - limit, float(b @ r.coefficients)
    square = slope**2 - Z95**2 * float(b @ c @ b)
    half = level * slope - Z95**2 * float(a @ c @ b)
    rest = level**2 - Z95**2 * float(a @ c @ a)
    room = half**2 - square * rest
    if square <= 0.0 or room < 0.0 or level * slope > 0.0:
        return None
    ends = sorted((-half + side * float(np.sqrt(room))) / square for side in (-1.0, 1.0))
    return Interval(-level / slope, *ends)
