"""The solver on curves whose minimum is known, and on simulations that run away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import central_jacobian, jacobian, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import Unknown, apply, start_vector, unknowns_of_rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import MEASURED, Channel

T, NOISE = np.linspace(0.0, 1.0, 200), 1e-4


@dataclass(frozen=True)
class Decay:
    """y = a exp(-b t), measured without noise; from a rate b of `cliff` on it runs away."""

    truth: tuple[float, float] = (2.0, 3.0)
    start: tuple[float, float] = (1.0, 1.0)
    cliff: float = np.inf

    @property
    def unknowns(self):
        return tuple(
            Unknown(name, start, "1", 0.0, 100.0, False, np.inf, 1.0)
            for name, start in zip(("a", "b"), self.start, strict=True)
        )

    def residual(self, theta):
        if theta[1] >= self.cliff:
            return np.full(len(T), np.nan)
        return (theta[0] * np.exp(-theta[1] * T) - self.truth[0] * np.exp(-self.truth[1] * T)) / NOISE


def test_the_minimum_of_a_curve_is_found():
    assert solve(Decay()).theta == pytest.approx([2.0, 3.0], rel=1e-5)


def test_a_cliff_behind_the_minimum_is_avoided():
    """A step over the cliff is shortened; an unknown whose derivative would cross it is held for a while."""
    solution = solve(Decay(start=(1.0, 3.4), cliff=3.40001))
    assert np.isfinite(solution.cost) and solution.theta[1] < 3.40001
    assert solve(Decay(cliff=3.1)).theta == pytest.approx([2.0, 3.0], rel=1e-5)


@dataclass(frozen=True)
class Bent(Decay):
    """Rosenbrock's valley y = x^2: Marquardt's steps along it are tiny."""

    truth: tuple[float, float] = (40.0, 1600.0)
    start: tuple[float, float] = (1.0, 1.0)

    @property
    def unknowns(self):
        return tuple(Unknown(n, 1.0, "1", 0.0, 1e4, False, np.inf, 1.0) for n in ("a", "b"))

    def residual(self, theta):
        return np.array([10.0 * (theta[1] - theta[0] ** 2), theta[0] - self.truth[0]])


def test_a_bent_valley_is_followed():
    assert solve(Bent(), iterations=25).theta == pytest.approx([40.0, 1600.0], rel=1e-2)


def test_a_start_beyond_the_cliff_is_returned_at_an_infinite_cost():
    solution = solve(Decay(start=(1.0, 5.0), cliff=4.0))
    assert solution.cost == np.inf and solution.theta == pytest.approx([1.0, 5.0])


def test_derivatives_across_the_cliff_are_zero():
    problem = Decay(start=(1.0, 3.4), cliff=3.40001)
    theta = np.array([1.0, 3.4])
    columns = jacobian_columns(problem, theta, problem.residual(theta), (0, 1))
    assert columns[:, 0].any() and not columns[:, 1].any()


@pytest.mark.parametrize("worst", [np.nan, np.inf, 1e200])
def test_the_power_of_a_diverged_simulation_is_infinite(worst):
    assert power(np.array([1.0, worst])) == np.inf
    assert power(np.array([1.0, 2.0])) == 5.0


def test_a_value_that_may_vanish_is_zero_where_only_rounding_is_left_of_it():
    """A fit ended at a damping of 9e-15 N m s/rad, which no rig may have: the diagnosis broke off."""
    rig = load_rig("paper_high_impedance")
    unknowns = unknowns_of_rig(rig)
    theta = start_vector(unknowns)
    theta[[u.name for u in unknowns].index("spring.damping")] = 9.12863e-15
    assert apply(rig, unknowns, theta)[0]["spring.damping"] == 0.0


def test_derivatives_are_exact_enough_for_the_end_of_a_bent_valley():
    """Curvature taken for slope, 2.5e-4 of it: a soft base stayed far from its minimum, a mode was named."""
    rig = load_rig("paper_high_impedance")
    command = excitation("multisine", ExcitationSettings(rate=280.0, duration=10.0, amplitude=20.0))
    record = synthesize(rig, Channel(np.arange(len(command)) / 280.0, command), seed=1)
    case = case_from(record, rig)
    problem = Problem((case,), rig, unknowns_of_rig(rig), MEASURED)
    theta = start_vector(problem.unknowns)
    exact = central_jacobian(problem, theta)
    off = jacobian(problem, theta, problem.residual(theta)) - exact
    assert np.all(np.linalg.norm(off, axis=0) < 5e-5 * np.linalg.norm(exact, axis=0))
