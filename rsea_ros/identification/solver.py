"""Gauss-Newton with Marquardt's damping on output errors and priors, and the threads that it works in.

Two pools, because a fit waits for its derivatives: a single pool full of fits would wait for itself.

The cost is ||r(theta)||^2 + sum ((theta - theta_0) / doubt)^2: residuals over their noise, priors over
their doubt. Derivatives by forward differences of the simulation; those of the clocks by central ones, of
all sensors at once.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg.blas import dger
from threadpoolctl import ThreadpoolController

from rsea_ros.identification.problem import Problem, simulate_cases
from rsea_ros.identification.unknowns import SMOOTH, Unknown, apply, bounds_of, start_vector
from rsea_ros.records.record import FloatArray

_CLOCK_DIFFERENCE = 1e-6
"""s. Sensors are read so much earlier and later for the derivatives by their clocks."""
_SMALLEST_GAIN = 1e-6
_SMALLEST_FALL = 0.5
"""Of the cost: less than a standard deviation of one parameter, after which next to nothing is left."""
_RUN_AWAY = 1e100
"""Noises from which a simulation is unstable, not wrong."""
_AS_PROMISED = 0.5
"""Of the fall of the cost that the derivatives promise: a step that brings so much speaks for them."""
_WEAK = 1e-6
"""Of the curvature: damping that shortens no step of unknowns that show."""
_AHEAD, _MOST_BENT = 0.1, 1.5
"""Share of a step over which its second derivative is taken; how large the correction may be beside the step.

Where two unknowns compensate for each other (a base's stiffness and inertia, beside a spring) the cost is a
bent valley, in which Marquardt's steps become tiny: the correction to second order follows it (geodesic
acceleration: Transtrum, Sethna, arXiv 1201.5885, 2012, with these numbers)."""


@dataclass(frozen=True)
class Solution:
    """theta in the fit's coordinates, the weighted residual there (m,), its derivatives (m, n), the cost."""

    problem: Problem
    theta: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    cost: float

    @property
    def values(self) -> dict[str, float]:
        """Return every unknown in SI."""
        return {u.name: u.outer(float(t)) for u, t in zip(self.problem.unknowns, self.theta, strict=True)}

    @property
    def rms(self) -> float:
        """Return the RMS of the residual over the noise."""
        return float(np.sqrt(np.mean(self.residual**2)))


Map = Callable[[Callable[[int], FloatArray], Sequence[int]], Sequence[FloatArray]]


def serial(function: Callable[[int], FloatArray], items: Sequence[int]) -> Sequence[FloatArray]:
    """Apply a function to items one after another."""
    return [function(i) for i in items]


def jacobian(problem: Problem, theta: FloatArray, residual: FloatArray, run: Map = serial) -> FloatArray:
    """Return d residual / d theta, shape (m, n)."""
    return jacobian_columns(problem, theta, residual, range(len(theta)), run)


def jacobian_columns(
    problem: Problem, theta: FloatArray, residual: FloatArray, which: Sequence[int], run: Map = serial
) -> FloatArray:
    """Return columns of d residual / d theta, shape (m, len(which)). residual: at theta.

    Zero where a step of the unknown makes the simulation run away.
    """
    clocks = {i: problem.unknowns[i] for i in which if problem.unknowns[i].is_clock}
    others = [i for i in which if i not in clocks]

    def column(i: int) -> FloatArray:
        unknown = problem.unknowns[i]
        moved = theta.copy()
        step = unknown.difference * unknown.scale
        beyond = theta[i] + step > unknown.inner(unknown.high)
        moved[i] += -step if beyond else step
        shifted, before, width = problem.residual(moved), residual, moved[i] - theta[i]
        if unknown.difference > SMOOTH:  # of a jump the samples on either side of it
            moved[i] -= 2.0 * width
            before, width = problem.residual(moved), 2.0 * width
        if np.inf in (power(shifted), power(before)):
            return np.zeros(len(residual))
        return np.asarray((shifted - before) / width)

    columns = dict(zip(others, run(column, others), strict=True))
    if clocks:
        of_clocks = clock_columns(problem, theta, tuple(clocks.values()))
        columns |= dict(zip(clocks, of_clocks.T, strict=True))
    return np.column_stack([columns[i] for i in which]) if len(which) else np.empty((len(residual), 0))


def clock_columns(problem: Problem, theta: FloatArray, clocks: Sequence[Unknown]) -> FloatArray:
    """Return d residual / d clock for unknown clocks, be they among the problem's or not, shape (m, n)."""
    rig, read = apply(problem.rig, problem.unknowns, theta)
    moved = [read.move(sign * _CLOCK_DIFFERENCE, problem.channels) for sign in (1, -1)]
    outputs = simulate_cases(problem.cases, rig, *moved, on_angle=problem.on_angle)
    later, earlier = map(problem.residual_of, outputs)
    slope = (later - earlier) / (2.0 * _CLOCK_DIFFERENCE)
    channel = problem.by_row(lambda case, n: problem.channels.index(n))
    since = 1e-6 * problem.since_start()
    own = [(channel == problem.channels.index(c.name.split(".")[1]), c.is_rate) for c in clocks]
    return np.column_stack([np.where(at, slope, 0.0) * (since if is_rate else 1.0) for at, is_rate in own])


def power(residual: FloatArray) -> float:
    """Return the sum of squares of a residual; infinite where the simulation ran away."""
    return float(residual @ residual) if np.max(np.abs(residual), initial=0.0) < _RUN_AWAY else np.inf


def central_jacobian(problem: Problem, theta: FloatArray, run: Map = serial) -> FloatArray:
    """Return d residual / d theta by central differences, which leave no trace of curvature, shape (m, n)."""

    def column(i: int) -> FloatArray:
        unknown, step = problem.unknowns[i], np.zeros(len(theta))
        is_offset = unknown.is_clock and not unknown.is_rate
        step[i] = _CLOCK_DIFFERENCE if is_offset else unknown.difference * unknown.scale
        return np.asarray((problem.residual(theta + step) - problem.residual(theta - step)) / (2.0 * step[i]))

    return np.column_stack(run(column, range(len(theta))))


def solve(problem: Problem, theta: FloatArray | None = None, *, iterations: int = 25, run: Map = serial,
          gain: float = _SMALLEST_GAIN, matrix: FloatArray | None = None) -> Solution:  # fmt: skip
    """Minimise from theta (or the unknowns' starts). gain: smallest relative fall of the cost to go on.

    matrix: derivatives to begin with, those of a fit that ended near, shape (m, n).
    A start at which the simulation diverges is returned unchanged, at an infinite cost.
    Where a step gains as the derivatives predict, they are kept and only corrected along the step
    (Broyden, Math. Comp. 19, 1965); otherwise, or where no step helps, they are recomputed.
    """
    start = start_vector(problem.unknowns)
    theta = start.copy() if theta is None else theta.copy()
    weight = 1.0 / np.array([u.doubt for u in problem.unknowns])

    def cost_of(r: FloatArray, at: FloatArray) -> float:
        return power(r) + float(np.sum((weight * (at - start)) ** 2))

    residual = problem.residual(theta)
    cost, damping = cost_of(residual, theta), 1e-7
    if cost == np.inf:
        return Solution(problem, theta, residual, np.zeros((len(residual), len(theta))), cost)
    is_fresh = matrix is None
    matrix = jacobian(problem, theta, residual, run) if matrix is None else matrix
    for _ in range(iterations):
        more = 2.0
        normal = matrix.T @ matrix + np.diag(weight**2)
        slope = matrix.T @ residual + weight**2 * (theta - start)
        accepted = kept = False
        for _ in range(9 if is_fresh else 1):
            scaled = normal + damping * np.diag(np.diag(normal) + 1e-12)
            trial = bounded_step(problem, theta, scaled, slope)
            trial_residual = problem.residual(trial)
            trial_cost, along = cost_of(trial_residual, trial), matrix @ (trial - theta)
            kept = cost - trial_cost > _AS_PROMISED * (cost - cost_of(residual + along, trial))
            if is_fresh and not kept:
                bent = _along_the_bend(problem, theta, residual, trial, along, matrix, scaled)
                bent_residual = trial_residual if bent is trial else problem.residual(bent)
                bent_cost = cost_of(bent_residual, bent)
                if bent_cost < trial_cost:
                    trial, trial_residual, trial_cost = bent, bent_residual, bent_cost
            accepted = trial_cost < cost
            if accepted:
                break
            if is_fresh:
                damping, more = damping * more, 2.0 * more
        if not accepted and is_fresh:
            break
        if not accepted:
            matrix, is_fresh = jacobian(problem, theta, residual, run), True
            continue
        least = max(gain * cost, _SMALLEST_FALL)
        enough = cost - trial_cost < least
        if enough and damping > _WEAK:  # a tiny step of a bent valley says nothing of its end
            whole = bounded_step(problem, theta, normal, slope)
            enough = cost - cost_of(residual + matrix @ (whole - theta), whole) < least
        if kept:
            matrix = broyden_update(matrix, trial - theta, trial_residual - residual)
        theta, residual, cost = trial, trial_residual, trial_cost
        damping = max(damping / (10.0 if kept else 3.0), 1e-10)
        if enough:  # and too small a step to change the derivatives
            break
        if not kept:
            matrix = jacobian(problem, theta, residual, run)
        is_fresh = not kept
    return Solution(problem, theta, residual, matrix, cost)


@dataclass(frozen=True)
class Descent:
    """Where a descent ended: the residual without its prior, shape (m,), and the cost with it."""

    theta: FloatArray
    residual: FloatArray
    cost: float


def descend(
    residual: Callable[[FloatArray], FloatArray], slope: Callable[[FloatArray, FloatArray], FloatArray],
    theta: FloatArray, information: FloatArray, *, rounds: int = 15, enough: float = 1e-3,
    parts: Sequence[float] = (1.0, 0.5, 0.25, 0.1, 0.03),
) -> Descent:  # fmt: skip
    """Minimise a residual beside a prior by Gauss-Newton, every step cut until it helps.

    slope: derivatives (m, n) at theta and its residual. information: of the prior, (n, n), about the start.
    enough: relative fall of the cost that is too small to go on. parts: of a step, tried till the cost falls.
    """

    def at(place: FloatArray) -> Descent:
        r, off = residual(place), place - theta
        return Descent(place, r, power(r) + float(off @ information @ off))

    best = at(theta)
    for _ in range(rounds):
        matrix = slope(best.theta, best.residual)
        right = matrix.T @ best.residual + information @ (best.theta - theta)
        step = -np.linalg.lstsq(matrix.T @ matrix + information, right, rcond=None)[0]
        trials = (at(best.theta + part * step) for part in parts)
        better = next((t for t in trials if t.cost < best.cost), None)
        if better is None:
            break
        fall, best = best.cost - better.cost, better
        if fall < enough * (best.cost + fall):
            break
    return best


def _along_the_bend(
    problem: Problem, theta: FloatArray, residual: FloatArray, trial: FloatArray, along: FloatArray,
    matrix: FloatArray, normal: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return the end of a step from theta moved to where the valley bends, or `trial` where that is too far.

    along: change of the residual by the derivatives.
    """
    step = trial - theta
    ahead = problem.residual(theta + _AHEAD * step)
    if power(ahead) == np.inf:
        return trial
    bend = 2.0 / _AHEAD * ((ahead - residual) / _AHEAD - along)
    aside = -0.5 * np.linalg.lstsq(normal, matrix.T @ bend, rcond=None)[0]
    size = np.sqrt(np.diag(normal))
    if np.linalg.norm(size * aside) > _MOST_BENT * np.linalg.norm(size * step):
        return trial
    return np.asarray(np.clip(trial + aside, *bounds_of(problem.unknowns)))


def broyden_update(matrix: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """Return the derivatives nearest to `matrix`, each in its own scale, that give the change of a step.

    Source: Broyden, Mathematics of Computation 19, 1965, with scaled unknowns.
    """
    size = np.einsum("ij,ij->j", matrix, matrix)
    along = size * step / max(float(size @ step**2), 1e-300)
    return np.asarray(dger(1.0, along, change - matrix @ step, a=matrix.T).T)


def bounded_step(problem: Problem, theta: FloatArray, normal: FloatArray, slope: FloatArray) -> FloatArray:
    """Return theta - normal^-1 slope inside the bounds.

    An unknown that reaches a bound stays at it, and the others compensate.
    """
    low, high = bounds_of(problem.unknowns)
    step, free = np.zeros(len(theta)), np.ones(len(theta), bool)
    for _ in range(4):
        right = slope[free] - normal[np.ix_(free, ~free)] @ -step[~free]
        step[free] = -np.linalg.lstsq(normal[np.ix_(free, free)], right, rcond=None)[0]
        beyond = free & ((theta + step < low) | (theta + step > high))
        if not beyond.any():
            break
        step[beyond] = np.clip(theta + step, low, high)[beyond] - theta[beyond]
        free &= ~beyond
    return np.clip(theta + step, low, high)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS from starting threads inside a with statement; else a fit takes four times as long."""
    with _libraries().limit(limits=1, user_api="blas"):
        yield


_libraries = cache(ThreadpoolController)
_CORES: ContextVar[int] = ContextVar("cores", default=2)


def cores() -> int:
    """Return how many cores a fit may use."""
    return _CORES.get()


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Set the number of cores for fits within a with statement: 1 where a program runs several at once."""
    token = _CORES.set(count)
    try:
        yield
    finally:
        _CORES.reset(token)


@dataclass(frozen=True)
class Pools:
    """Where fits run, and how one makes its derivatives."""

    fits: Executor
    run: Map


@contextmanager
def worker_pools() -> Iterator[Pools]:
    """Hold both pools within a with statement; linear algebra keeps to one thread meanwhile."""
    with one_blas_thread(), ThreadPoolExecutor(cores()) as fits, ThreadPoolExecutor(cores()) as threads:
        # the simulation runs without the interpreter's lock
        yield Pools(fits, (lambda f, items: list(threads.map(f, items))) if cores() > 1 else serial)
