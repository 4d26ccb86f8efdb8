"""Hypotheses: every effect of the catalogue tried on the residual, cheaply and generously.

From each start one simulation and one derivative for each of the effect's parameters; the nominal values
move along with the derivatives they already have. Two such steps show what a full fit would gain. A mode is
too sharp for that: near it the nominal values need derivatives of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.effects.effect import Effect
from rsea_ros.errors import RseaError
from rsea_ros.identification.alternatives import extended
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution, bounded_step, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.signals import FloatArray

_STEPS = 2


@dataclass(frozen=True)
class ScreenedEffect:
    """An effect beside the present model, with where a full fit would begin and the cost already reached."""

    effect: Effect
    problem: Problem
    theta: FloatArray
    cost: float

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def without_effect(problem: Problem, theta: FloatArray, name: str) -> tuple[Problem, FloatArray]:
    """Return a problem without one of its effects, and theta without its parameters."""
    keep = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    rig = problem.rig.with_effects(*(e for e in problem.rig.effects if e.name != name))
    return replace(problem, rig=rig, unknowns=tuple(problem.unknowns[i] for i in keep)), theta[keep]


def screen(present: Solution, effect: Effect, starts: Sequence[dict[str, float]]) -> ScreenedEffect | None:
    """Return the best of an effect's starts after two cheap steps; None for an effect the rig cannot have.

    A start may also name values of the rig, which begin there then: no longer where the derivatives are.
    """
    best: ScreenedEffect | None = None
    for start in starts:
        own = {name: value for name, value in start.items() if "." not in name}
        there = moved(present, {name: value for name, value in start.items() if "." in name})
        try_start = _with_new_derivatives if is_mode(effect) or there is not present else _from_start
        try:
            tried = try_start(there, effect, own)
        except RseaError:
            continue
        if tried is not None and (best is None or tried.cost < best.cost):
            best = tried
    return best


def moved(present: Solution, values: Mapping[str, float]) -> Solution:
    """Return a solution with some of its unknowns at other values; itself when there are none to move."""
    theta = present.theta.copy()
    for i, unknown in enumerate(present.problem.unknowns):
        if unknown.name in values:
            theta[i] = unknown.inner(values[unknown.name])
    return present if (theta == present.theta).all() else replace(present, theta=theta)


def is_mode(effect: Effect) -> bool:
    """Tell whether an effect adds a mode: a mode has a damping ratio."""
    return any(p.name == "damping_ratio" for p in effect.parameters)


def _with_new_derivatives(present: Solution, effect: Effect, start: dict[str, float]) -> ScreenedEffect:
    solution = solve(*extended(present.problem, present.theta, effect, start), iterations=_STEPS)
    problem = solution.problem
    return ScreenedEffect(effect, problem, solution.theta, solution.cost)


def _from_start(present: Solution, effect: Effect, start: dict[str, float]) -> ScreenedEffect | None:
    """Return where two steps lead; None for an effect that no channel shows there, or that runs away."""
    problem, theta = extended(present.problem, present.theta, effect, start)
    n = len(present.theta)
    prior = np.array([1.0 / u.doubt for u in problem.unknowns])
    centre = start_vector(problem.unknowns)
    residual = problem.residual(theta)
    if power(residual) == np.inf:
        return None
    own = jacobian_columns(problem, theta, residual, range(n, len(theta)))
    if not own.any():
        return None
    matrix = np.column_stack([present.jacobian, own])
    normal = matrix.T @ matrix + np.diag(prior**2)
    normal += np.diag(1e-6 * np.diag(normal) + 1e-12)
    cost = power(residual) + float(np.sum((prior * (theta - centre)) ** 2))
    best = ScreenedEffect(effect, problem, theta, cost)
    for _ in range(_STEPS):
        slope = matrix.T @ residual + prior**2 * (theta - centre)
        aim = bounded_step(problem, theta, normal, slope)
        for share in (1.0, 0.3):
            trial = theta + share * (aim - theta)
            trial_residual = problem.residual(trial)
            cost = power(trial_residual) + float(np.sum((prior * (trial - centre)) ** 2))
            if cost < best.cost:
                break
        else:
            break
        theta, residual = trial, trial_residual
        best = ScreenedEffect(effect, problem, theta, cost)
    return best
