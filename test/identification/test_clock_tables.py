"""Which clocks a fit asks for, and the line of a channel's lag, as tables with answers worked out by hand."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rsea_ros.identification import clocks
from rsea_ros.identification.clocks import (
    RequiredClocks,
    _lag_of,
    _lags,
    free_clocks,
    lag_line,
    without_needless,
)
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown


def unknown(name, doubt=math.inf):
    return Unknown(name, 0.0, "s", -1e9, 1e9, False, doubt, 1.0)


FT, POSITION = unknown("clock.ft"), unknown("clock.position")
FT_RATE = unknown("clock_rate.ft")


@dataclass(frozen=True)
class Problem:
    """The part of a problem that the test of the clocks uses."""

    unknowns: tuple


def solution(residual, *columns, doubt=math.inf, theta=None, names=None):
    """A solution of a linear problem; columns: of its jacobian."""
    names = names or [f"value.{k}" for k in range(len(columns))]
    unknowns = tuple(unknown(n, doubt) for n in names)
    jacobian = np.array(columns, float).T.reshape(len(residual), len(columns))
    theta = np.zeros(len(columns)) if theta is None else np.array(theta)
    return Solution(Problem(unknowns), theta, np.array(residual, float), jacobian, 0.0)


ONE_BLOCK, OWN_BLOCKS = np.zeros(4, np.int64), np.arange(4)


@pytest.mark.parametrize(
    ("jacobian", "doubt", "residual", "blocks", "z"),
    [
        # apart from the other unknown: c'r / sqrt(c'c)
        ((1, 0, 0, 0), math.inf, (0, 3, 1, 0), ONE_BLOCK, 8.0 / math.sqrt(8.0)),
        ((1, 0, 0, 0), math.inf, (0, -3, -1, 0), ONE_BLOCK, 8.0 / math.sqrt(8.0)),  # late or early
        ((1, 0, 0, 0), math.inf, (0, 9, 1, 0), ONE_BLOCK, 20.0 / math.sqrt(8.0)),
        # blocks that disagree: +8 and -8 beside what both say
        ((1, 0, 0, 0), math.inf, (0, 9, 1, 0), OWN_BLOCKS, 20.0 / math.sqrt(128.0)),
        ((1, 0, 0, 0), math.inf, (0, 5, 5, 0), OWN_BLOCKS, 20.0 / math.sqrt(8.0)),  # they agree
        # half of it is the other unknown's: c - J/2 has 2 x 2 (1/2)^2 of c'c left
        ((1, 1, 1, 1), math.inf, (-2, 2, 2, -2), ONE_BLOCK, 8.0 / math.sqrt(4.0)),
        # less of it where that one is known beforehand: c - J 4/(4 + 4)
        ((1, 1, 1, 1), 0.5, (-2, 2, 2, -2), ONE_BLOCK, 8.0 / math.sqrt(2 * 1.5**2 + 2 * 0.5**2)),
        ((0, 1, 1, 0), math.inf, (1, 0, 0, 1), ONE_BLOCK, 0.0),  # the other unknown itself
    ],
)
def test_a_clock_is_asked_for_by_its_standard_deviations(jacobian, doubt, residual, blocks, z):
    fit = solution(residual, jacobian, doubt=doubt)
    columns = np.array([[0.0, 2.0, 2.0, 0.0]]).T
    assert clocks._score(fit, columns, [0], [FT], blocks) == pytest.approx(z, abs=1e-9)


@pytest.mark.parametrize(
    ("doubt", "z"),
    [
        (math.inf, 2.0 / math.sqrt(1.5)),  # (0 2 2 2) less the first clock's 2: (0 0 0 2)
        # the first is known to 1/sqrt(2): c'r/(2 + 2) = 1 of it; the second less a quarter of the first
        (math.sqrt(0.5), 2.5 / math.sqrt(0.25**2 + 0.75**2 + 1.0)),
    ],
)
def test_a_second_clock_is_asked_for_beside_the_first(doubt, z):
    fit = solution((0, 2, 2, 2), (1, 0, 0, 0))
    columns = np.array([(0, 0, 1, 1), (9, 9, 9, 9), (0, 1, 1, 0)], float).T
    left = [POSITION, FT_RATE, unknown("clock.ft", doubt)]
    assert clocks._score(fit, columns, [2, 0], left, ONE_BLOCK) == pytest.approx(z)


@pytest.mark.parametrize(
    ("doubt", "clock_doubt", "wider"),
    [
        (math.inf, math.inf, 2.0),  # 1/2 becomes 1: the inverse of (2 1, 1 1)
        (math.inf, 1.0, 4.0 / 3.0),  # of (2 1, 1 2)
        (1.0, math.inf, 1.5),  # 1/3 becomes 1/2: of (3 1, 1 1)
        (1.0, 0.5, 15.0 / 14.0),  # of (3 1, 1 5)
    ],
)
def test_a_free_clock_widens_an_interval_by_a_known_factor(doubt, clock_doubt, wider):
    fit = solution((0, 0, 0, 0), (1, 1, 0, 0), (0, 0, 0, 3), doubt=doubt, names=["near", "apart"])
    columns = np.array([(1, 0, 0, 0)], float).T
    cost = clocks._cost(fit, columns, [unknown("clock.ft", clock_doubt)])
    assert cost == pytest.approx({"near": math.sqrt(wider), "apart": 1.0})


@pytest.mark.parametrize("shown", [0.0, 1e-10])
def test_clocks_cost_an_unknown_nothing_that_the_data_do_not_show(shown):
    """Beside one that they show: rounding over rounding made its interval 6e130 times as wide."""
    fit = solution((0, 0), (shown, shown), (1e8, 0))
    cost = clocks._cost(fit, np.array([[1.0], [0.0]]), [FT])
    assert list(cost) == ["value.1"]


def test_requested_clocks_start_at_zero_offset():
    fit = solution((0, 0), (1, 0), theta=[0.5])
    problem, theta = free_clocks(fit, RequiredClocks((FT, FT_RATE)))
    assert [u.name for u in problem.unknowns] == ["value.0", "clock.ft", "clock_rate.ft"]
    assert theta.tolist() == [0.5, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "doubt", "jacobian", "theta", "kept"),
    [
        ("value", math.inf, 2.0, 0.0, True),  # no clock
        ("clock.ft", math.inf, 2.0, 1.0, False),  # 2 standard deviations of 1/2
        ("clock.ft", math.inf, 2.0, 1.01, True),
        ("clock.ft", math.inf, 2.0, -1.01, True),
        ("clock_rate.ft", math.inf, 2.0, 0.99, False),
        ("clock.ft", 0.5, 1.5, 0.81, True),  # known beforehand to 1/2: 0.4 together
        ("clock.ft", 0.5, 1.5, 0.79, False),
    ],
)
def test_a_clock_within_two_standard_deviations_of_right_is_taken_as_right(
    name, doubt, jacobian, theta, kept
):
    fit = solution((0, 0), (1, 0), (0, jacobian), theta=[0.0, theta], doubt=doubt, names=["other", name])
    problem, left = without_needless(fit)
    assert [u.name for u in problem.unknowns] == (["other", name] if kept else ["other"])
    assert left.tolist() == ([0.0, theta] if kept else [0.0])


@pytest.mark.parametrize(
    ("cost", "said"),
    [(None, ()), ({}, ()), ({"a": 1.0, "b": 1.9}, ()), ({"a": 2.0, "b": 1.0}, ("a", 2.0)),
     ({"a": 2.0, "b": 3.0, "c": 1.0}, ("b", 3.0))],
)  # fmt: skip
def test_the_largest_cost_is_reported_from_a_factor_of_two(cost, said):
    assert [(r.code, r.names, r.values) for r in RequiredClocks((), cost).remarks] == [
        ("clocks_taken_as_right", said[:1], said[1:])
    ] * bool(said)


START, RATE = 5.0, 200.0


def instants(seconds, rate=RATE):
    return START + np.arange(int(seconds * rate)) / rate


def wave(t):
    """A signal with its slope; a second is no whole number of its periods."""
    a, b = 2.6 * np.pi, 4.2 * np.pi
    return np.sin(a * t) + np.cos(b * t), a * np.cos(a * t) - b * np.sin(b * t)


def delayed(t, lag):
    """Return that signal as a sensor stamps it that is `lag` late (s)."""
    return wave(t - lag)[0]


def line_of(lag, seconds=12.0, keep=slice(None), amplitude=1.0, start=START):
    """The line that is has_line of a lag that is given since the start of the record."""
    t = instants(seconds)[keep]
    return lag_line(t, amplitude * delayed(t, lag(t - START)), wave(t)[0], start)


@pytest.mark.parametrize("rate", [400e-6, -400e-6, 490e-6])
@pytest.mark.parametrize("first", [0.0, 1e-3])
def test_a_lag_that_grows_along_a_line_is_found_with_its_sign(rate, first):
    line = line_of(lambda since: first + rate * since)
    assert line.rate == pytest.approx(rate, rel=2e-2)
    assert line.rise == pytest.approx(12.0 * rate, rel=2e-2)
    assert line.scatter < 0.02 * abs(line.rise) and line.is_clear


@pytest.mark.parametrize(("seconds", "has_line"), [(6.9, False), (7.9, True)])
def test_a_line_needs_eight_blocks_of_a_second(seconds, has_line):
    assert (line_of(lambda since: 400e-6 * since, seconds) is not None) is has_line


def test_a_lag_that_jumps_scatters_about_its_line():
    """By a quarter of the step, and the line rises by 3/2 of the step, of blocks that show the same."""
    line = line_of(lambda since: np.where(since < 6.0, 0.0, 1.6e-3))
    assert line.scatter == pytest.approx(0.4e-3, rel=0.1)
    assert line.rise == pytest.approx(2.4e-3, rel=0.1)


def test_blocks_that_the_simulation_does_not_explain_are_left_out():
    """Four seconds of something else: the lag goes on along its line behind them."""
    t = instants(14.0)
    y = delayed(t, 500e-6 * (t - START))
    other = (t >= START + 5.0) & (t < START + 9.0)
    y[other] = np.cos(7.3 * t[other])
    line = lag_line(t, y, wave(t)[0], START)
    assert line.rate == pytest.approx(500e-6, rel=2e-2) and line.scatter < 1e-4
    assert lag_line(t, np.where(t < START + 8.0, np.cos(7.3 * t), y), wave(t)[0], START) is None


def test_a_lag_follows_a_jump_by_two_milliseconds_a_block():
    t = instants(10.0)
    lag = np.where(t < START + 4.0, 0.0, 5e-3)
    since, lags, _ = _lags(t, delayed(t, lag), wave(t)[0], START)
    assert lags == pytest.approx([0, 0, 0, 0, 2e-3, 4e-3, 5e-3, 5e-3, 5e-3, 5e-3], abs=5e-5)
    assert since == pytest.approx(np.arange(10) + 0.4975)


def test_blocks_weigh_as_much_as_they_show():
    """The second half is quiet, and its lag is off."""
    t = instants(16.0)
    loud = np.where(t < START + 8.0, 1.0, 0.01)
    lag = np.where(t < START + 8.0, 500e-6 * (t - START), 4e-3)
    line = lag_line(t, loud * delayed(t, lag), loud * wave(t)[0], START)
    assert line.rate == pytest.approx(500e-6, rel=0.02)


def test_a_simulation_at_rest_shows_no_lag():
    t = instants(2.0)
    still = np.zeros(len(t))
    assert _lag_of(t, wave(t)[0], (t, still, still), 4e-3, 2e-3) == (4e-3, 0.0)
    assert lag_line(t, wave(t)[0], still, START) is None
