"""Gauss-Newton with Marquardt's damping on output errors and priors.

The cost is ||r(theta)||^2 + sum ((theta - theta_0) / doubt)^2: residuals over their noise, priors over
their doubt. Derivatives by forward differences of the simulation; those of the clocks from the time
derivative of the simulated channels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from rsea_ros.identification.problem import Problem
from rsea_ros.identification.unknowns import CLOCK, Unknown, start_vector
from rsea_ros.signals import FloatArray

_DIFFERENCE = 1e-4
_SMALLEST_GAIN = 1e-6


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


Outputs = list[dict[str, FloatArray]]
Map = Callable[[Callable[[int], FloatArray], Sequence[int]], Sequence[FloatArray]]


def serial(function: Callable[[int], FloatArray], items: Sequence[int]) -> Sequence[FloatArray]:
    """Apply a function to items one after another."""
    return [function(i) for i in items]


def in_pool(pool: Executor) -> Map:
    """Return a map that uses a pool; the simulation runs without the interpreter's lock."""
    return lambda function, items: list(pool.map(function, items))


def jacobian(
    problem: Problem, theta: FloatArray, residual: FloatArray, outputs: Outputs, run: Map = serial
) -> FloatArray:
    """Return d residual / d theta, shape (m, n)."""
    return jacobian_columns(problem, theta, residual, range(len(theta)), outputs, run)


def jacobian_columns(problem: Problem, theta: FloatArray, residual: FloatArray, which: Sequence[int],
                     outputs: Outputs | None = None, run: Map = serial) -> FloatArray:  # fmt: skip
    """Return columns of d residual / d theta, shape (m, len(which)). outputs: at theta, for the clocks."""

    def column(i: int) -> FloatArray:
        unknown = problem.unknowns[i]
        if unknown.name.startswith(CLOCK + ".") and outputs is not None:
            return _clock_column(problem, outputs, unknown.name.split(".")[1])
        moved = theta.copy()
        step = _DIFFERENCE * unknown.scale
        beyond = theta[i] + step > unknown.inner(unknown.high)
        moved[i] += -step if beyond else step
        slope: FloatArray = (problem.residual(moved) - residual) / (moved[i] - theta[i])
        return slope

    return np.column_stack(list(run(column, which))) if len(which) else np.empty((len(residual), 0))


def _clock_column(problem: Problem, outputs: Outputs, channel: str) -> FloatArray:
    parts = []
    for case, out in zip(problem.cases, outputs, strict=True):
        for name in problem.present(case):
            rate = (
                np.gradient(out[name], case.t[name]) / case.noise[name]
                if name == channel
                else np.zeros(len(out[name]))
            )
            parts.append(np.nan_to_num(rate[case.mask[name]]))
    return np.concatenate(parts)


def solve(problem: Problem, theta: FloatArray | None = None, *, iterations: int = 25, run: Map = serial,
          gain: float = _SMALLEST_GAIN) -> Solution:  # fmt: skip
    """Minimise from theta (or the unknowns' starts). gain: smallest relative fall of the cost to go on."""
    start = start_vector(problem.unknowns)
    theta = start.copy() if theta is None else theta.copy()
    weight = 1.0 / np.array([u.doubt for u in problem.unknowns])

    def cost_of(r: FloatArray, at: FloatArray) -> float:
        total = float(r @ r) + float(np.sum((weight * (at - start)) ** 2))
        return total if np.isfinite(total) else np.inf

    outputs = problem.outputs(theta)
    residual = problem.residual_of(outputs)
    cost, damping = cost_of(residual, theta), 1e-7
    matrix = jacobian(problem, theta, residual, outputs, run)
    for _ in range(iterations):
        normal = matrix.T @ matrix + np.diag(weight**2)
        slope = matrix.T @ residual + weight**2 * (theta - start)
        accepted = False
        for _ in range(8):
            scaled = normal + damping * np.diag(np.diag(normal) + 1e-12)
            trial = bounded_step(problem, theta, scaled, slope)
            trial_outputs = problem.outputs(trial)
            trial_residual = problem.residual_of(trial_outputs)
            trial_cost = cost_of(trial_residual, trial)
            if trial_cost < cost:
                accepted = True
                break
            damping *= 30.0
        if not accepted:
            break
        fall = (cost - trial_cost) / cost
        theta, residual, outputs, cost = trial, trial_residual, trial_outputs, trial_cost
        damping = max(damping / 10.0, 1e-10)
        matrix = jacobian(problem, theta, residual, outputs, run)
        if fall < gain:
            break
    return Solution(problem, theta, residual, matrix, cost)


def linearised(problem: Problem, theta: FloatArray) -> Solution:
    """Return where a problem stands at theta, without a step."""
    outputs = problem.outputs(theta)
    residual = problem.residual_of(outputs)
    prior = sum(((t - u.inner(u.start)) / u.doubt) ** 2 for t, u in zip(theta, problem.unknowns, strict=True))
    return Solution(
        problem,
        theta,
        residual,
        jacobian(problem, theta, residual, outputs),
        float(residual @ residual + prior),
    )


def bounded_step(problem: Problem, theta: FloatArray, normal: FloatArray, slope: FloatArray) -> FloatArray:
    """Return theta - normal^-1 slope inside the bounds.

    What meets a bound stays there and the rest makes up for it.
    """
    low, high = (np.array([u.inner(b(u)) for u in problem.unknowns]) for b in (_lowest, _highest))
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


def _lowest(unknown: Unknown) -> float:
    return max(unknown.low, 1e-300) if unknown.logarithmic else unknown.low


def _highest(unknown: Unknown) -> float:
    return unknown.high
