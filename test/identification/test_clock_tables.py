"""Which clocks a fit asks for, as tables: small linear problems whose answers are worked out by hand."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rsea_ros.identification import clocks
from rsea_ros.identification.clocks import RequiredClocks, free_clocks, without_needless
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
