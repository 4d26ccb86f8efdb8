"""The solver on curves whose minimum is known, its steps beside linear algebra, and runs that diverge."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from runs import RIG, excited
from scipy.optimize import lsq_linear

from rsea_ros.identification import solver
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import central_jacobian, jacobian, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import JUMPING, Unknown, apply, start_vector, unknowns_of_rig
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


RNG = np.random.default_rng(2)
A, B = RNG.standard_normal((30, 3)), RNG.standard_normal(30)


def unknown(name, start=0.0, low=-100.0, high=100.0, doubt=np.inf, scale=1.0, **more):
    return Unknown(name, start, "1", low, high, False, doubt, scale, **more)


@dataclass(frozen=True)
class Linear:
    """r = A theta - B, and how often it was asked for."""

    unknowns: tuple[Unknown, ...] = (unknown("x"), unknown("y"), unknown("z"))
    asked: list = field(default_factory=list)

    def residual(self, theta):
        self.asked.append(theta.copy())
        return A @ theta - B


def test_a_linear_fit_is_the_ridge_of_its_priors_in_one_step():
    problem = Linear((unknown("x", 1.0, doubt=0.1), unknown("y", -2.0, doubt=0.3), unknown("z")))
    weight, start = np.array([10.0, 1.0 / 0.3, 0.0]), np.array([1.0, -2.0, 0.0])
    whole, right = np.vstack([A, np.diag(weight)]), np.append(B, weight * start)
    best = np.linalg.lstsq(whole, right, rcond=None)[0]
    found = solver.solve(problem)
    assert found.theta == pytest.approx(best, abs=1e-6)
    assert found.cost == pytest.approx(float(np.sum((whole @ best - right) ** 2)))
    assert found.jacobian == pytest.approx(A, abs=1e-4)
    assert found.residual == pytest.approx(A @ found.theta - B)
    assert found.rms == pytest.approx(np.sqrt(np.mean(found.residual**2)))
    assert found.values == pytest.approx(dict(zip("xyz", best, strict=True)), abs=1e-6)
    assert len(problem.asked) <= 7
    given = Linear()
    solver.solve(given, np.array([3.0, 3.0, 3.0]), matrix=A)
    assert len(given.asked) <= 4 and given.asked[0].tolist() == [3.0, 3.0, 3.0]
    wrong = solver.solve(Linear(), np.array([3.0, 3.0, 3.0]), matrix=-A)
    assert wrong.theta == pytest.approx(np.linalg.lstsq(A, B, rcond=None)[0], abs=1e-5)


def test_a_step_stays_inside_its_bounds_and_the_rest_makes_up_for_it():
    free = np.linalg.lstsq(A, B, rcond=None)[0]
    wide = np.full(3, 9.0)
    for low, high in ((-wide, wide), ([free[0] + 0.2, -9.0, -9.0], wide), (-wide, [9.0, free[1] - 0.1, 9.0])):
        unknowns = tuple(unknown(n, low=a, high=b) for n, a, b in zip("xyz", low, high, strict=True))
        theta = np.clip([0.5, -0.5, 0.2], low, high)
        found = solver.bounded_step(Linear(unknowns), theta, A.T @ A, A.T @ (A @ theta - B))
        assert found == pytest.approx(lsq_linear(A, B, (low, high)).x, abs=1e-9)


def test_derivatives_step_inwards_at_a_bound_and_to_both_sides_of_a_jump():
    at_bound = Linear((unknown("x", high=1.0), unknown("y"), unknown("z", scale=10.0)))
    theta = np.array([1.0, 0.5, 0.5])
    found = solver.jacobian_columns(at_bound, theta, at_bound.residual(theta), [2, 0])
    assert found == pytest.approx(A[:, [2, 0]], abs=1e-4)
    steps = [(place - theta)[k] for place, k in zip(at_bound.asked[1:], (2, 0), strict=True)]
    small = at_bound.unknowns[0].difference
    assert steps == pytest.approx([10.0 * small, -small], rel=1e-6)
    assert solver.jacobian_columns(at_bound, theta, B, []).shape == (30, 0)
    jumps = Linear((unknown("x", difference=JUMPING), *Linear().unknowns[1:]))
    solver.jacobian_columns(jumps, theta, np.full(30, 1e9), [0])
    assert [place[0] for place in jumps.asked] == pytest.approx([1.0 + JUMPING, 1.0 - JUMPING])
    central = Linear((unknown("x", scale=2.0), *Linear().unknowns[1:]))
    assert solver.central_jacobian(central, theta) == pytest.approx(A, abs=1e-5)
    either = [place[0] for place in central.asked[:2]]
    assert either == pytest.approx([1.0 + 2.0 * small, 1.0 - 2.0 * small])


def test_kept_derivatives_give_the_change_of_the_last_step_and_are_the_nearest_that_do():
    matrix, step, change = A.copy(), np.array([0.1, -0.2, 0.3]), RNG.standard_normal(30)
    new = solver.broyden_update(matrix, step, change)
    assert new @ step == pytest.approx(change)
    size = np.sqrt(np.sum(A**2, axis=0))
    scaled = (new - A) / size  # the least change of scaled derivatives lies along the scaled step
    along = size * step
    assert scaled == pytest.approx(np.outer(scaled @ along, along) / (along @ along))
    assert solver.broyden_update(A.copy(), np.zeros(3), np.zeros(30)) == pytest.approx(A)


def test_a_descent_is_the_ridge_about_its_start_and_is_cut_until_it_helps():
    start, information = np.array([1.0, 0.0, 0.0]), np.diag([4.0, 0.0, 1.0])
    best = np.linalg.solve(A.T @ A + information, A.T @ B + information @ start)
    found = solver.descend(lambda x: A @ x - B, lambda x, r: A, start, information)
    off = best - start
    assert found.theta == pytest.approx(best)
    assert found.residual == pytest.approx(A @ best - B)
    assert found.cost == pytest.approx(np.sum((A @ best - B) ** 2) + off @ information @ off)
    calls = []

    def steep(x):
        calls.append(float(x[0]))
        return np.arctan(5.0 * x)

    slope = lambda x, r: np.diag(5.0 / (1.0 + 25.0 * x**2))  # noqa: E731
    one = solver.descend(steep, slope, np.array([2.0]), np.zeros((1, 1)))
    assert abs(one.theta[0]) < 0.05 and calls[0] == 2.0
    assert calls[2] - 2.0 == pytest.approx(0.5 * (calls[1] - 2.0))
    few: list[float] = []
    solver.descend(lambda x: (few.append(1.0), A @ x - B)[1], lambda x, r: A, start, information, rounds=1)
    assert len(few) == 2
    stuck = solver.descend(lambda x: A @ x - B, lambda x, r: -A, start, np.zeros((3, 3)))
    assert stuck.theta is start


def test_a_fit_has_the_cores_that_it_is_given():
    before = solver.cores()
    with solver.on_cores(1):
        assert solver.cores() == 1
        with solver.worker_pools() as pools:
            assert pools.run is solver.serial
    assert solver.cores() == before
    with solver.on_cores(3), solver.worker_pools() as pools:
        assert pools.run(lambda k: np.full(1, k), [1, 2, 3]) == [1, 2, 3] and pools.fits._max_workers == 3


def test_values_of_a_solution_are_in_si():
    inverse = replace(unknown("k"), logarithmic=True)
    solution = solver.Solution(Linear((inverse,)), np.array([np.log(50.0)]), B, A, 0.0)
    assert solution.values == {"k": pytest.approx(50.0)}
