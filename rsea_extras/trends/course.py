"""The course of a quantity over days, by regression; its levels, slopes, sizes, and the time to a limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from rsea_extras.trends.days import Days
from rsea_extras.trends.result import Interval
from rsea_extras.trends.series import DAY
from rsea_ros.extension.base import Z95, FloatArray

_DEPENDENT = 1e-10
"""Eigenvalue of scaled normal equations, relative to the largest, from which columns count as dependent."""
Kind = Literal["step", "ramp"]
"""A step of the level, or a change of the slope, from a day on."""


@dataclass(frozen=True)
class Regression:
    """y = X b + noise of variance 1/w, with a normal prior of mean 0 on some of b.

    x: shape (n, p). y, w: shape (n,). precision: of the prior, shape (p,), 0 for none.
    """

    x: FloatArray
    y: FloatArray
    w: FloatArray
    precision: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """Return that of b, shape (p, p)."""
        scale = 1.0 / np.sqrt(
            np.maximum(np.sum(self.w[:, None] * self.x**2, axis=0) + self.precision, 1e-300)
        )
        normal = (self.x * scale).T @ (self.w[:, None] * self.x * scale) + np.diag(self.precision * scale**2)
        size, axes = np.linalg.eigh(normal)
        known = size > _DEPENDENT * size[-1]
        axes = scale[:, None] * axes[:, known]
        return np.asarray(axes / size[known] @ axes.T)

    @cached_property
    def coefficients(self) -> FloatArray:
        """Return b, shape (p,)."""
        return np.asarray(self.covariance @ (self.x.T @ (self.w * self.y)))

    @property
    def loss(self) -> float:
        """Return the weighted sum of squares of the residual, the prior's part included."""
        return float(np.sum(self.w * self.y**2) - self.coefficients @ (self.x.T @ (self.w * self.y)))

    def combine(self, row: FloatArray) -> Interval:
        """Return a linear combination of b with its interval. row: shape (p,)."""
        variance = float(row @ self.covariance @ row)
        value, half = float(row @ self.coefficients), Z95 * float(np.sqrt(max(0.0, variance)))
        return Interval(value, value - half, value + half)

    def with_columns(self, columns: FloatArray) -> Regression:
        """Return the regression with further columns, shape (n, k), without a prior."""
        more = np.concatenate([self.precision, np.zeros(columns.shape[1])])
        return Regression(np.column_stack([self.x, columns]), self.y, self.w, more)


def term(kind: Kind, t: FloatArray, at: float) -> FloatArray:
    """Return the column of a term that begins at a time: 0 before, then 1, or the time since."""
    return (t >= at).astype(float) if kind == "step" else np.maximum(t - at, 0.0)


def scan(base: Regression, t: FloatArray, kind: Kind) -> FloatArray:
    """Return the z score of a term that begins at each day, beside those of `base`, shape (n,); t rises.

    Its square is the gain in twice the log likelihood. O(n): sums from each day to the last.
    """

    def after(values: FloatArray) -> FloatArray:
        return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])

    covariance, w = base.covariance, base.w
    wr, wx = w * (base.y - base.x @ base.coefficients), w[:, None] * base.x
    cross, mixed, square = after(wr), after(wx), after(w)
    if kind == "ramp":
        square = after(w * t**2) - 2.0 * t * after(w * t) + t**2 * square
        cross = after(wr * t) - t * cross
        mixed = after(wx * t[:, None]) - t[:, None] * mixed
    left = square - np.einsum("ki,ij,kj->k", mixed, covariance, mixed)
    sure = left > 1e-9 * np.max(square)
    return np.asarray(np.where(sure, cross / np.sqrt(np.where(sure, left, 1.0)), 0.0))


@dataclass(frozen=True)
class StepOrRamp:
    """A step or a ramp from the day with this index on."""

    kind: Kind
    index: int


@dataclass(frozen=True)
class Course:
    """Days with their weights and the terms that describe them.

    base: level, and temperature with the fleet's prior where it is logged. day_variance: of the day effect,
    in units of the scale squared. slope: whether the first piece has a slope of its own. warm: per K, the
    prior's mean, taken off the values already.
    """

    days: Days
    base: Regression
    day_variance: float
    warm: float = 0.0
    slope: bool = False
    terms: tuple[StepOrRamp, ...] = ()

    def with_term(self, i: int, *term: StepOrRamp) -> Course:
        """Return the course with another term, or none, in a term's place."""
        return replace(self, terms=(*self.terms[:i], *term, *self.terms[i + 1 :]))

    @property
    def t(self) -> FloatArray:
        """Return days from the first one on, shape (n,)."""
        return np.asarray(self.days.t - self.days.t[0])

    def regression(self, without: int = -1) -> Regression:
        """Return the regression with all terms but one; slope first, then the terms in their order."""
        t = self.t
        columns = [t] if self.slope else []
        columns += [term(k.kind, t, t[k.index]) for i, k in enumerate(self.terms) if i != without]
        return self.base.with_columns(np.column_stack(columns)) if columns else self.base

    @property
    def at(self) -> int:
        """Return the place of the slope, or of the first term, among the coefficients."""
        return int(self.base.x.shape[1])

    def fit_values(self) -> FloatArray:
        """Return the course without temperature and without the level, shape (n,)."""
        r = self.regression()
        return np.asarray(r.x[:, self.at :] @ r.coefficients[self.at :])

    def level_row(self, t: float) -> FloatArray:
        """Return the combination of coefficients that is the level at a time, days from the first on."""
        terms = [float(term(k.kind, np.array([t]), self.t[k.index])[0]) for k in self.terms]
        return np.array([1.0, *[0.0] * (self.at - 1), *([t] if self.slope else []), *terms])

    def slope_row(self, last: int) -> FloatArray:
        """Return the combination of coefficients that is the slope after the ramps up to a term's place."""
        ramps = [float(k.kind == "ramp" and i <= last) for i, k in enumerate(self.terms)]
        return np.array([*[0.0] * self.at, *([1.0] if self.slope else []), *ramps])

    def level(self, t: float) -> Interval:
        """Return the level at a time, days from the first on, at the mean temperature."""
        return self.regression().combine(self.level_row(t))

    def slope_after(self, last: int) -> Interval:
        """Return the slope, per day, after the ramps up to a place; -1: before all."""
        return self.regression().combine(self.slope_row(last))

    def step_size(self, i: int) -> Interval:
        """Return the size of the step at a term's place."""
        first = self.at + self.slope
        return self.regression().combine(np.eye(first + len(self.terms))[first + i])

    def ramp_size(self, last: int) -> Interval:
        """Return the change that a ramp adds until the next one or the end; -1: the first slope."""
        begin = self.t[self.terms[last].index] if last >= 0 else 0.0
        later = [self.t[k.index] for k in self.terms[last + 1 :] if k.kind == "ramp"]
        return self.slope_after(last).times(float(min([*later, self.t[-1]]) - begin))


def course_of(days: Days, day_variance: float, prior: tuple[float, float]) -> Course:
    """Return the course without a change. prior: mean and sd of the temperature slope, per K, relative."""
    w = 1.0 / (days.variance + day_variance)
    level = np.ones((len(days.y), 1))
    if days.warmth is None:
        return Course(days, Regression(level, days.y, w, np.zeros(1)), day_variance)
    y = days.y - prior[0] * days.warmth
    x = np.column_stack([level, days.warmth])
    base = Regression(x, y, w, np.array([0.0, 1.0 / prior[1] ** 2]))
    return Course(days, base, day_variance, prior[0])


def refine(course: Course, fewest: int) -> Course:
    """Return the course with each term at its best day, beside the others at theirs."""
    for i, old in enumerate(course.terms):
        gain = scan(course.regression(without=i), course.t, old.kind) ** 2
        alike = [k.index for j, k in enumerate(course.terms) if j != i and k.kind == old.kind]
        course = course.with_term(i, replace(old, index=int(np.argmax(allowed_gains(gain, alike, fewest)))))
    return replace(course, terms=tuple(sorted(course.terms, key=lambda k: k.index)))


def cost(course: Course, price: float) -> float:
    """Return the loss and the price of all terms; a slope from the first day on has no date to be found."""
    return course.regression().loss + price * (len(course.terms) + 0.6 * course.slope)


def improve(course: Course, price: float, fewest: int) -> Course:
    """Return the cheapest course by leaving out, or turning into the other kind, one term after the other."""
    course = refine(course, fewest)
    best = cost(course, price)
    while True:
        others = [refine(c, fewest) for c in _neighbours(course)]
        costs = [cost(c, price) for c in others]
        if not costs or min(costs) >= best - 1e-9:
            return course
        best = min(costs)
        course = others[costs.index(best)]


def _neighbours(course: Course) -> Iterator[Course]:
    """Yield the courses that differ in one term, first those with one less."""
    if course.slope:
        yield replace(course, slope=False)
    for i in range(len(course.terms)):
        yield course.with_term(i)
    for i, old in enumerate(course.terms):
        other = StepOrRamp("ramp" if old.kind == "step" else "step", old.index)
        if other not in course.terms:
            yield course.with_term(i, other)


def allowed_gains(gain: FloatArray, taken: Sequence[int], fewest: int) -> FloatArray:
    """Return the gains, none within `fewest` days of an end or of another term of the kind."""
    allowed: FloatArray = gain.copy()
    allowed[:fewest] = -1.0
    allowed[len(gain) - fewest + 1 :] = -1.0
    for k in taken:
        allowed[max(0, k - fewest + 1) : k + fewest] = -1.0
    return allowed


_SURE_SLOPE = 3.0
"""|z| of a slope from which it is a trend: one in 370, of a series that is more than noise."""


@dataclass(frozen=True)
class Dated:
    """A course, the days on which its terms may begin, and it with each term at both ends of these."""

    course: Course
    ranges: tuple[tuple[int, int], ...]
    moved: tuple[tuple[Course, ...], ...]

    def interval(self, of: Callable[..., Interval], *at: float) -> Interval:
        """Return a quantity of the course, such as Course.level at a time; its interval spans the dates too,
        in quadrature."""
        best = of(self.course, *at)
        apart = [[of(c, *at).value - best.value for c in pair] for pair in self.moved]
        below = np.sqrt((best.value - best.low) ** 2 + sum(min(0.0, *pair) ** 2 for pair in apart))
        above = np.sqrt((best.high - best.value) ** 2 + sum(max(0.0, *pair) ** 2 for pair in apart))
        return Interval(best.value, best.value - float(below), best.value + float(above))


def date_course(course: Course, doubt: float) -> Dated:
    """Return a course with the ranges of its dates. doubt: fall of twice the log likelihood."""
    ranges, moved = [], []
    for i, old in enumerate(course.terms):
        gain = scan(course.regression(without=i), course.t, old.kind) ** 2
        likely = np.flatnonzero(gain >= gain[old.index] - doubt)
        first, last = min(int(likely[0]), old.index), max(int(likely[-1]), old.index)
        ranges.append((first, last))
        moved.append(tuple(course.with_term(i, replace(old, index=at)) for at in (first, last)))
    return Dated(course, tuple(ranges), tuple(moved))


def last_slope(whole: Dated) -> Interval:
    """Return the slope of the last piece, per day, also where it is not part of the course."""
    course = whole.course
    if course.slope or any(k.kind == "ramp" for k in course.terms):
        return whole.interval(Course.slope_after, len(course.terms) - 1)
    start = max((k.index for k in course.terms), default=0)
    if len(course.t) - start < 3 or course.t[-1] <= course.t[start]:
        return Interval(0.0, -np.inf, np.inf)
    longer = replace(course, terms=(*course.terms, StepOrRamp("ramp", start)))
    return longer.step_size(len(course.terms))


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
    a, b = course.level_row(float(course.t[-1])), course.slope_row(len(course.terms) - 1)
    level, slope = float(a @ r.coefficients) - limit, float(b @ r.coefficients)
    square = slope**2 - Z95**2 * float(b @ c @ b)
    half = level * slope - Z95**2 * float(a @ c @ b)
    rest = level**2 - Z95**2 * float(a @ c @ a)
    room = half**2 - square * rest
    if square <= 0.0 or room < 0.0 or level * slope > 0.0:
        return None
    ends = sorted((-half + side * float(np.sqrt(room))) / square for side in (-1.0, 1.0))
    return Interval(-level / slope, *ends)
