"""The course of a parameter: a level, temperature, steps and ramps, each with its date and size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.trends.days import Days
from rsea_ros.trends.regression import Kind, Regression, scan, term


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
