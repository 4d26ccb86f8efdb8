"""Courses of a quantity: what sums over days and closed forms give equals least squares written out."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rsea_extras.trends import course as courses
from rsea_extras.trends.course import (
    Course,
    Dated,
    Regression,
    StepOrRamp,
    course_of,
    date_course,
    refine,
    scan,
)
from rsea_extras.trends.course_search import breaks
from rsea_extras.trends.days import Days
from rsea_extras.trends.result import Interval

N = 40
FIRST = 20_000.0
STEP, RAMP = StepOrRamp("step", 12), StepOrRamp("ramp", 25)


def days_of(y, sd=0.01, warmth=None):
    t = FIRST + np.arange(len(y)) * 2.0
    return Days(t, np.asarray(y, float), np.full(len(y), sd**2), warmth, 25.0, 1500.0)


def columns(course: Course) -> np.ndarray:
    """Return level, slope and terms of a course without temperature, each by its definition."""
    t = course.days.t - FIRST
    made = [np.ones(len(t))] + ([t] if course.slope else [])
    for k in course.terms:
        made.append(np.where(np.arange(len(t)) >= k.index, 1.0 if k.kind == "step" else t - t[k.index], 0.0))
    return np.column_stack(made)


def bent(noise=0.0, seed=1, **options):
    """Return 2, from day 12 on 2.5, from day 25 on rising by 0.03 a day (samples every second day)."""
    t = 2.0 * np.arange(N)
    y = 2.0 + 0.5 * (np.arange(N) >= 12) + 0.03 * np.maximum(t - t[25], 0.0)
    y = y + noise * np.random.default_rng(seed).standard_normal(N)
    made = course_of(days_of(y, **options), 0.0, (0.0, 1.0))
    return Course(made.days, made.base, 0.0, terms=(STEP, RAMP))


def test_a_regression_with_a_prior_is_that_of_the_normal_equations() -> None:
    rng = np.random.default_rng(3)
    x, y, w = rng.standard_normal((30, 3)) * [1.0, 50.0, 0.01], rng.standard_normal(30), rng.uniform(1, 9, 30)
    precision = np.array([0.0, 4.0, 0.5])
    normal = x.T @ np.diag(w) @ x + np.diag(precision)
    b = np.linalg.solve(normal, x.T @ (w * y))
    r = Regression(x, y, w, precision)
    np.testing.assert_allclose(r.covariance, np.linalg.inv(normal), rtol=1e-8)
    np.testing.assert_allclose(r.coefficients, b, rtol=1e-8)
    assert r.loss == pytest.approx(np.sum(w * (y - x @ b) ** 2) + np.sum(precision * b**2))
    double = Regression(np.column_stack([x, x[:, 0]]), y, w, np.append(precision, 0.0)).coefficients
    assert double[0] == pytest.approx(double[3]) and double[0] + double[3] == pytest.approx(b[0], rel=1e-6)


@pytest.mark.parametrize("kind", ["step", "ramp"])
def test_the_scores_of_a_scan_are_those_of_one_regression_for_each_day(kind) -> None:
    rng = np.random.default_rng(4)
    warmth = rng.standard_normal(N)
    days = days_of(1.0 + 0.1 * rng.standard_normal(N), warmth=warmth)
    days.variance[:] = rng.uniform(0.5, 2.0, N) * 1e-2
    course = course_of(days, 0.004, (0.02, 0.5))
    np.testing.assert_allclose(course.base.w, 1.0 / (days.variance + 0.004))
    np.testing.assert_allclose(course.base.y, days.y - 0.02 * warmth)
    np.testing.assert_allclose(course.base.precision, [0.0, 4.0])
    assert (course.at, course.warm, course.day_variance) == (2, 0.02, 0.004)
    t = course.t
    z = scan(course.base, t, kind)
    w, y, x = course.base.w, course.base.y, course.base.x
    for at in range(1, N - 1):
        column = np.where(np.arange(N) >= at, 1.0 if kind == "step" else t - t[at], 0.0)
        whole = np.column_stack([x, column])
        covariance = np.linalg.inv(whole.T @ (w[:, None] * whole) + np.diag([0.0, 4.0, 0.0]))
        size = (covariance @ whole.T @ (w * y))[-1]
        assert z[at] == pytest.approx(size / np.sqrt(covariance[-1, -1]), rel=1e-6)
    assert z[0 if kind == "step" else -1] == 0.0


def test_levels_slopes_sizes_and_their_intervals_are_those_of_least_squares() -> None:
    course = bent(noise=0.01)
    x, y = columns(course), course.days.y
    covariance = np.linalg.inv(x.T @ x) * 1e-4
    b = np.linalg.lstsq(x, y, rcond=None)[0]
    t = course.t

    def expect(given, row, factor=1.0):
        row = factor * np.asarray(row, float)
        half = 1.959964 * np.sqrt(row @ covariance @ row)
        np.testing.assert_allclose(
            (given.value, given.low, given.high), row @ b + np.array([0.0, -half, half]), rtol=1e-5
        )

    expect(course.level(t[0]), [1, 0, 0])
    expect(course.level(t[12]), [1, 1, 0])
    expect(course.level(t[-1] + 5.0), [1, 1, t[-1] + 5.0 - t[25]])
    expect(course.step_size(0), [0, 1, 0])
    expect(course.step_size(1), [0, 0, 1])
    expect(course.slope_after(1), [0, 0, 1])
    expect(course.ramp_size(1), [0, 0, 1], t[-1] - t[25])
    assert course.slope_after(0) == Interval(0.0, 0.0, 0.0)
    np.testing.assert_allclose(course.fit_values(), x[:, 1:] @ b[1:], atol=1e-9)
    assert courses.cost(course, 7.0) == pytest.approx(np.sum((y - x @ b) ** 2) / 1e-4 + 14.0)

    later = StepOrRamp("ramp", 30)
    sloped = Course(course.days, course.base, 0.0, slope=True, terms=(StepOrRamp("ramp", 10), later))
    x = columns(sloped)
    covariance, b = np.linalg.inv(x.T @ x) * 1e-4, np.linalg.lstsq(x, y, rcond=None)[0]
    expect(sloped.slope_after(-1), [0, 1, 0, 0])
    expect(sloped.slope_after(0), [0, 1, 1, 0])
    expect(sloped.ramp_size(-1), [0, 1, 0, 0], t[10])
    expect(sloped.ramp_size(0), [0, 1, 1, 0], t[30] - t[10])
    expect(courses.last_slope(Dated(sloped, (), ())), [0, 1, 1, 1])
    assert courses.cost(sloped, 7.0) == pytest.approx(np.sum((y - x @ b) ** 2) / 1e-4 + 2.6 * 7.0)


def test_a_last_piece_without_a_slope_is_asked_for_one() -> None:
    steps = Course(*(getattr(bent(0.01), n) for n in ("days", "base")), 0.0, terms=(STEP,))
    x = np.column_stack([columns(steps), np.maximum(steps.t - steps.t[12], 0.0)])
    b = np.linalg.lstsq(x, steps.days.y, rcond=None)[0]
    assert courses.last_slope(Dated(steps, (), ())).value == pytest.approx(b[-1])
    for at, is_asked in ((N - 3, True), (N - 2, False)):
        short = Course(steps.days, steps.base, 0.0, terms=(StepOrRamp("step", at),))
        assert np.isfinite(courses.last_slope(Dated(short, (), ())).low) == is_asked
    flat = course_of(days_of(np.ones(2)), 0.0, (0.0, 1.0))
    assert courses.last_slope(Dated(flat, (), ())) == Interval(0.0, -np.inf, np.inf)


def test_gains_are_allowed_away_from_ends_and_terms() -> None:
    allowed = courses.allowed_gains(np.ones(20), [10], 3)
    assert np.flatnonzero(allowed == 1.0).tolist() == [3, 4, 5, 6, 7, 13, 14, 15, 16, 17]
    assert np.flatnonzero(courses.allowed_gains(np.ones(8), [1], 2) == -1.0).tolist() == [0, 1, 2, 7]


def test_terms_are_moved_to_their_best_days_in_order_and_too_many_are_left_out() -> None:
    exact = bent(noise=1e-4)
    moved = refine(Course(exact.days, exact.base, 0.0, terms=(StepOrRamp("ramp", 27), STEP)), 3)
    assert moved.terms == (STEP, RAMP)
    near = Course(exact.days, exact.base, 0.0, terms=(StepOrRamp("step", 12), StepOrRamp("step", 14)))
    first, second = (k.index for k in refine(near, 3).terms)
    assert first == 12 and second - first >= 3
    ramp = Course(exact.days, exact.base, 0.0, slope=True, terms=(StepOrRamp("ramp", 12), RAMP, STEP))
    assert courses.improve(ramp, 20.0, 3).terms == (STEP, RAMP) and not courses.improve(ramp, 20.0, 3).slope
    turned = Course(exact.days, exact.base, 0.0, terms=(StepOrRamp("ramp", 12), RAMP))
    assert courses.improve(turned, 20.0, 3).terms == (STEP, RAMP)


def test_dates_are_as_sure_as_the_likelihood_and_widen_intervals() -> None:
    course = bent(noise=0.2, sd=0.2)
    at = refine(course, 3)
    dated = date_course(at, 3.84)
    for i, (first, last) in enumerate(dated.ranges):
        losses = [
            at.with_term(i, StepOrRamp(at.terms[i].kind, k)).regression().loss for k in range(1, N - 1)
        ]
        likely = 1 + np.flatnonzero(np.array(losses) <= losses[at.terms[i].index - 1] + 3.84)
        assert (first, last) == (likely[0], likely[-1]) and last > first
        assert [c.terms[i].index for c in dated.moved[i]] == [first, last]
    best, whole = at.step_size(0), dated.interval(Course.step_size, 0)
    apart = np.array([[c.step_size(0).value - best.value for c in pair] for pair in dated.moved])
    below = np.hypot(best.value - best.low, np.linalg.norm(np.minimum(apart.min(axis=1), 0.0)))
    above = np.hypot(best.high - best.value, np.linalg.norm(np.maximum(apart.max(axis=1), 0.0)))
    assert whole == pytest.approx((best.value, best.value - below, best.value + above))


def test_a_limit_is_reached_where_the_line_may_meet_it() -> None:
    """Fieller: at both ends of the interval the line is 1.96 of its own standard deviations off the limit."""
    course = bent(noise=0.01)
    alone = Dated(course, (), ())
    reached = courses.time_to_limit(alone, 4.0)
    assert reached is not None
    x = columns(course)
    covariance = np.linalg.inv(x.T @ x) * 1e-4
    b = np.linalg.lstsq(x, course.days.y, rcond=None)[0]
    rows = [np.array([1.0, 1.0, when / 86400.0 - FIRST - course.t[25]]) for when in reached]
    off = [(row @ b - 4.0) / np.sqrt(row @ covariance @ row) for row in rows]
    assert off == pytest.approx([0.0, -1.959964, 1.959964], abs=1e-4)
    assert courses.time_to_limit(alone, 1.0) is None
    flat = course_of(days_of(1.0 + 0.01 * np.random.default_rng(2).standard_normal(N)), 0.0, (0.0, 1.0))
    sloped = Course(flat.days, flat.base, 0.0, slope=True)
    assert courses.time_to_limit(Dated(sloped, (), ()), 4.0) is None
    assert courses.time_to_limit(Dated(course, ((0, 0),), ((course, sloped),)), 4.0) is None
    both = courses.time_to_limit(Dated(course, ((12, 12),), ((course, course),)), 4.0)
    assert both == pytest.approx(reached)


@pytest.mark.parametrize(("value", "sure"), [(3.01, True), (2.99, False), (-3.01, True), (-2.99, False)])
def test_a_slope_of_three_standard_deviations_is_sure(value, sure) -> None:
    side, other = (1.959964, 50.0) if value > 0.0 else (50.0, 1.959964)
    assert courses.is_sure(Interval(value, value - side, value + other)) == sure


@pytest.mark.parametrize("piece", ["level", "line"])
def test_breaks_are_the_cheapest_of_all_partitions(piece) -> None:
    rng, n = np.random.default_rng(6), 16
    t, w = np.cumsum(rng.uniform(0.5, 2.0, n)), rng.uniform(50.0, 150.0, n)
    y = np.where(np.arange(n) < 6, 0.0, 1.0) + 0.1 * rng.standard_normal(n)
    y += 0.3 * np.maximum(t - t[11], 0.0)

    def loss(places) -> float:
        total = 0.0
        for a, b in zip((0, *places), (*places, n), strict=True):
            if b - a < 3:
                return np.inf
            fit = np.polyfit(t[a:b], y[a:b], int(piece == "line"), w=np.sqrt(w[a:b]))
            total += float(np.sum(w[a:b] * (y[a:b] - np.polyval(fit, t[a:b])) ** 2))
        return total + 12.0 * (len(places) + 1)

    every = [places for k in range(4) for places in combinations(range(1, n), k)]
    assert breaks(t, y, w, piece, 12.0, 3) == list(min(every, key=loss)) != []


def test_breaks_of_many_days_are_looked_for_at_eighty_places() -> None:
    y = np.where(np.arange(400) < 200, 0.0, 1.0)
    (at,) = breaks(np.arange(400.0), y, np.full(400, 100.0), "level", 12.0, 3)
    assert at == 200
