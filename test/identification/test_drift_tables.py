"""Which clock rates a misfit frees, as tables: scripted fits and lag lines in, the accepted fit out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rsea_ros.identification import clocks
from rsea_ros.identification.clocks import LagLine, with_drifts
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown

STATED, FITTED = 1.0, 3.0
"""The only unknown, as the rig states it and after the fit."""
CODES = {"ft": 0, "position": 10, "motor_torque": 20}
"""What an output carries: its channel, plus the number of the record."""
EDGE = 1.3
"""RMS over the noise up to which a fit is accepted as it is."""


@dataclass(frozen=True)
class Case:
    """A record: three samples of each channel, of which the middle one is masked."""

    channels: tuple
    start: float = 10.0

    @property
    def t(self):
        return {n: np.array([10.0, 11.0, 12.0]) for n in self.channels}

    @property
    def measured(self):
        return {n: np.array([1.0, 99.0, 2.0]) for n in self.channels}

    @property
    def mask(self):
        return {n: np.array([True, False, True]) for n in self.channels}


@dataclass(frozen=True)
class Problem:
    """The part of a problem that the search for drifts uses; its outputs carry channel and unknown."""

    unknowns: tuple = (Unknown("value", STATED, "s", -1e9, 1e9, False, math.inf, 1.0),)
    cases: tuple = (Case(("ft", "position")),)
    rig: str = "rig"

    def present(self, case):
        return case.channels

    def outputs(self, theta):
        return [
            {n: np.array([theta[0], 0.0, CODES[n] + k]) for n in case.channels}
            for k, case in enumerate(self.cases)
        ]


def fit(rms, theta=(FITTED,), problem=Problem()):
    """A fit whose residual has that RMS over the noise, and another mean of squares than of cubes."""
    return Solution(problem, np.array(theta), np.array([rms, -rms]), np.zeros((2, len(theta))), 0.0)


class World:
    """Scripted drifts and fits, by the unknown's value: rates, ppm by channel; rms of the fit with them."""

    def __init__(self, monkeypatch):
        self.rates, self.rms, self.begun, self.inverse = {}, {}, [], False
        monkeypatch.setattr(clocks, "is_inverse", lambda rig: self.inverse)
        monkeypatch.setattr(clocks, "_drifts", lambda problem, theta: self.rates.get(float(theta[0]), {}))
        monkeypatch.setattr(clocks, "solve", self.solve)

    def solve(self, problem, begin, run):
        assert run == "map"
        names = [u.name for u in problem.unknowns]
        self.begun.append(dict(zip(names, begin.tolist(), strict=True)))
        return fit(self.rms[float(begin[0])], begin, problem)

    def accepted(self, rms):
        """Return the unknowns of the accepted fit, None for the fit as it was, and the starts of all fits."""
        before = fit(rms)
        after = with_drifts(before, "map")
        return None if after is before else [u.name for u in after.problem.unknowns], self.begun


@pytest.fixture
def world(monkeypatch):
    return World(monkeypatch)


FROM_FIT = {"value": FITTED, "clock_rate.ft": 80.0}
FROM_STATED = {"value": STATED, "clock_rate.position": -40.0}


@pytest.mark.parametrize(
    ("rms", "rates", "left", "accepted", "begun"),
    [
        (EDGE, {FITTED: {"ft": 80.0}}, {FITTED: 1.0}, None, []),  # no misfit, no drift
        (2.0, {}, {}, None, []),  # no lag drifts along a line
        (2.0, {FITTED: {"ft": 80.0}}, {FITTED: EDGE}, ["value", "clock_rate.ft"], [FROM_FIT]),
        (1.4, {FITTED: {"ft": 80.0}}, {FITTED: 1.31}, None, [FROM_FIT]),  # it explains too little
        (
            2.0, {STATED: {"position": -40.0}}, {STATED: 1.0},
            ["value", "clock_rate.position"], [FROM_STATED],
        ),
        (
            2.0, {FITTED: {"ft": 80.0}, STATED: {"position": -40.0}}, {FITTED: 1.31, STATED: 1.0},
            ["value", "clock_rate.position"], [FROM_FIT, FROM_STATED],
        ),
        (
            2.0, {FITTED: {"position": 5.0, "ft": 80.0}}, {FITTED: 1.0},
            ["value", "clock_rate.ft", "clock_rate.position"], [{**FROM_FIT, "clock_rate.position": 5.0}],
        ),
    ],
)  # fmt: skip
def test_a_clock_that_drifts_is_freed_where_that_explains_a_misfit(world, rms, rates, left, accepted, begun):
    world.rates, world.rms = rates, left
    assert world.accepted(rms) == (accepted, begun)


def test_a_rig_that_is_judged_by_torque_has_no_drifts(world):
    world.inverse, world.rates, world.rms = True, {FITTED: {"ft": 80.0}}, {FITTED: 1.0}
    assert world.accepted(2.0) == (None, [])


CLEAR = LagLine(-80e-6, 0.0, -4.8e-3)
FLAT = LagLine(-1e-6, 0.0, -6e-5)
SCATTERED = LagLine(-80e-6, 2.4e-3, -4.8e-3)


def with_rate(rate):
    return CLEAR._replace(rate=rate)


@pytest.mark.parametrize(
    ("cases", "lines", "rates"),
    [
        ([("ft", "position")], {("ft", 0): CLEAR, ("position", 0): FLAT}, {"ft": 80.0}),
        ([("ft", "position")], {("ft", 0): SCATTERED}, {}),  # position: no line at all
        ([("ft", "motor_torque")], {("ft", 0): CLEAR, ("motor_torque", 0): CLEAR}, {"ft": 80.0}),
        (  # the median of the records, those without a clear line left out
            [("ft",)] * 4,
            {("ft", 0): CLEAR, ("ft", 1): with_rate(-10e-6), ("ft", 2): with_rate(70e-6), ("ft", 3): FLAT},
            {"ft": 10.0},
        ),
    ],
)
def test_the_rate_of_a_clock_is_that_of_its_lag_reversed(monkeypatch, cases, lines, rates):
    """In ppm: a lag that falls is a clock that runs fast, whose stamps come ever later."""
    problem = Problem(cases=tuple(map(Case, cases)))
    codes = {CODES[n] + k: (n, k) for k, channels in enumerate(cases) for n in channels}

    def lag_line(t, y, p, start):
        assert (t.tolist(), y.tolist(), start) == ([10.0, 12.0], [1.0, 2.0], 10.0), "valid samples only"
        assert p[0] == FITTED
        return lines.get(codes[p[1]])

    monkeypatch.setattr(clocks, "lag_line", lag_line)
    assert clocks._drifts(problem, np.array([FITTED])) == pytest.approx(rates)


@pytest.mark.parametrize(
    ("column", "reach", "shown"),
    [((0.6, 0.8), 1.0, True), ((0.6, 0.79), 1.0, False), ((0.0, 2.0), 0.5, True), ((0.0, 2.0), 0.49, False)],
)
def test_an_unknown_is_shown_by_one_standard_deviation_within_its_reach(column, reach, shown):
    unknown = Unknown("value", 0.0, "s", -1e9, 1e9, False, reach, 1.0)
    assert clocks._is_shown(np.array(column), unknown) is shown
