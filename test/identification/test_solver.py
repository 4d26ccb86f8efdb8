"""The solver on curves whose minimum is known, and on simulations that run away."""

from dataclasses import dataclass

import numpy as np
import pytest
from runs import RIG, excited

from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import central_jacobian, jacobian, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import Unknown, apply, start_vector, unknowns_of_rig
from rsea_ros.records.record import MEASURED

T, NOISE = np.linspace(0.0, 1.0, 200), 1e-4


@dataclass(frozen=True)
class Decay:
    """y = a exp(-b t), measured without noise; from a rate b of `cliff` on it runs away."""

    truth: tuple[float, float] = (2.0, 3.0)
    start: tuple[float, float] = (1.0, 1.0)
    cliff: float = np.inf

    @property
    def unknowns(self):
        starts = zip(("a", "b"), self.start, strict=True)
        return tuple(Unknown(name, start, "1", 0.0, 1e4, False, np.inf, 1.0) for name, start in starts)

    def residual(self, theta):
        if theta[1] >= self.cliff:
            return np.full(len(T), np.nan)
        return (theta[0] * np.exp(-theta[1] * T) - self.truth[0] * np.exp(-self.truth[1] * T)) / NOISE


def test_the_minimum_of_a_curve_is_found_and_a_cliff_behind_it_avoided():
    """A step over the cliff is shortened; an unknown whose derivative would cross it is held for a while."""
    assert solve(Decay()).theta == pytest.approx([2.0, 3.0], rel=1e-5)
    solution = solve(Decay(start=(1.0, 3.4), cliff=3.40001))
    assert np.isfinite(solution.cost) and solution.theta[1] < 3.40001
    assert solve(Decay(cliff=3.1)).theta == pytest.approx([2.0, 3.0], rel=1e-5)


@dataclass(frozen=True)
class Bent(Decay):
    """Rosenbrock's valley y = x^2: Marquardt's steps along it are tiny."""

    truth: tuple[float, float] = (40.0, 1600.0)

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
    unknowns = unknowns_of_rig(RIG)
    theta = start_vector(unknowns)
    theta[[u.name for u in unknowns].index("spring.damping")] = 9.12863e-15
    assert apply(RIG, unknowns, theta)[0]["spring.damping"] == 0.0


def test_derivatives_are_exact_enough_for_the_end_of_a_bent_valley():
    """Curvature taken for slope, 2.5e-4 of it: a soft base stayed far from its minimum, a mode was named."""
    record = excited(RIG, "multisine", sensors=1, duration=10.0, amplitude=20.0)
    problem = Problem((case_from(record, RIG),), RIG, unknowns_of_rig(RIG), MEASURED)
    theta = start_vector(problem.unknowns)
    exact = central_jacobian(problem, theta)
    off = jacobian(problem, theta, problem.residual(theta)) - exact
    assert np.all(np.linalg.norm(off, axis=0) < 5e-5 * np.linalg.norm(exact, axis=0))
