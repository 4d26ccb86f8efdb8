"""The course of a quantity over days, by regression."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.trends.days import Days

_LARGEST = 1e10
"""Entry of an inverse of scaled normal equations from which columns count as dependent."""
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
        inverse: FloatArray = _inverse(normal) * np.outer(scale, scale)
        return inverse

    @cached_property
    def coefficients(self) -> FloatArray:
        """Return b, shape (p,)."""
        b: FloatArray = self.covariance @ (self.x.T @ (self.w * self.y))
        return b

    @property
    def loss(self) -> float:
        """Return the weighted sum of squares of the residual, the prior's part included."""
        return float(np.sum(self.w * self.y**2) - self.coefficients @ (self.x.T @ (self.w * self.y)))

    def with_columns(self, columns: FloatArray) -> Regression:
        """Return the regression with further columns, shape (n, k), without a prior."""
        more = np.concatenate([self.precision, np.zeros(columns.shape[1])])
        return Regression(np.column_stack([self.x, columns]), self.y, self.w, more)


def _inverse(normal: FloatArray) -> FloatArray:
    """Return the inverse of scaled normal equations, the least one where columns depend on each other."""
    try:
        inverse = np.asarray(np.linalg.inv(normal), float)
    except np.linalg.LinAlgError:
        inverse = np.full_like(normal, np.inf)
    sure = np.max(np.abs(inverse)) < _LARGEST
    return inverse if sure else np.asarray(np.linalg.pinv(normal, hermitian=True), float)


def term(kind: Kind, t: FloatArray, at: float) -> FloatArray:
    """Return the column of a term that begins at a time: 0 before, then 1, or the time since."""
    return (t >= at).astype(float) if kind == "step" else np.maximum(t - at, 0.0)


def scan(base: Regression, t: FloatArray, kind: Kind) -> FloatArray:
    """Return the z score of a term that begins at each day, beside those of `base`, shape (n,); t rises.

    Its square is the gain in twice the log likelihood. O(n): sums from each day to the last.
    """

    def after(values: FloatArray) -> FloatArray:
        total: FloatArray = np.cumsum(values[::-1], axis=0)[::-1]
        return total

    covariance, w = base.covariance, base.w
    wr, wx = w * (base.y - base.x @ base.coefficients), w[:, None] * base.x
    cross, mixed, square = after(wr), after(wx), after(w)
    if kind == "ramp":
        square = after(w * t**2) - 2.0 * t * after(w * t) + t**2 * square
        cross = after(wr * t) - t * cross
        mixed = after(wx * t[:, None]) - t[:, None] * mixed
    left = square - np.einsum("ki,ij,kj->k", mixed, covariance, mixed)
    sure = left > 1e-9 * np.max(square)
    z: FloatArray = np.where(sure, cross / np.sqrt(np.where(sure, left, 1.0)), 0.0)
    return z


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

    @property
    def t(self) -> FloatArray:
        """Return days from the first one on, shape (n,)."""
        since: FloatArray = self.days.t - self.days.t[0]
        return since

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

    def at_mean_temperature(self) -> FloatArray:
        """Return the days' means without the effect of temperature, in units of the scale, shape (n,)."""
        r = self.regression()
        values: FloatArray = self.base.y - r.x[:, 1 : self.at] @ r.coefficients[1 : self.at]
        return values

    def fit_values(self) -> FloatArray:
        """Return the course without temperature and without the level, shape (n,)."""
        r = self.regression()
        course: FloatArray = r.x[:, self.at :] @ r.coefficients[self.at :]
        return course


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
        best = _allowed_gains(gain, alike, fewest)
        terms = list(course.terms)
        terms[i] = replace(old, index=int(np.argmax(best)))
        course = replace(course, terms=tuple(terms))
    return replace(course, terms=tuple(sorted(course.terms, key=lambda k: k.index)))


def date_range(course: Course, i: int, doubt: float) -> tuple[int, int]:
    """Return the first and last day on which a term may begin, by the fall of the likelihood."""
    old = course.terms[i]
    gain = scan(course.regression(without=i), course.t, old.kind) ** 2
    likely = np.flatnonzero(gain >= gain[old.index] - doubt)
    return int(min(likely[0], old.index)), int(max(likely[-1], old.index))


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
        yield replace(course, terms=course.terms[:i] + course.terms[i + 1 :])
    for i, old in enumerate(course.terms):
        other = StepOrRamp("ramp" if old.kind == "step" else "step", old.index)
        if other not in course.terms:
            yield replace(course, terms=(*course.terms[:i], other, *course.terms[i + 1 :]))


def _allowed_gains(gain: FloatArray, taken: Sequence[int], fewest: int) -> FloatArray:
    """Return the gains, none within `fewest` days of an end or of another term of the kind."""
    allowed: FloatArray = gain.copy()
    allowed[:fewest] = -1.0
    allowed[len(gain) - fewest + 1 :] = -1.0
    for k in taken:
        allowed[max(0, k - fewest + 1) : k + fewest] = -1.0
    return allowed
