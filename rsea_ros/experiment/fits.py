"""Fits of a cause to records, from several starts, because many have local minima."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.guess import Guess
from rsea_ros.experiment.hypothesis import NOTHING
from rsea_ros.experiment.prior import vector_at, weights_of
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Map, Solution, power, solve
from rsea_ros.signals import FloatArray

_SHARE = 0.15
"""Of a cause's typical size, where fits begin too."""
_LITTLE, _CLOSE = 4.0, 1.5
"""A fit whose cost lies between these, above the least and times the least, is begun once more."""
_GAIN = 1e-4
_ITERATIONS = 12


def fit_cause(
    name: str, problem: Problem, before: FloatArray | None, near: Mapping[str, float], run: Map
) -> Solution:
    """Return a cause fitted from the best of its guesses, and from where it was or the rig's own fit."""
    guesses = effect_named(name).default_guesses if name != NOTHING else [{}]
    named = [{f"{name}.{k}": v for k, v in guess.items()} for guess in [*guesses, *_smaller(name, guesses)]]
    rows = [vector_at(problem, {}, guess) for guess in named]
    others = [before] if before is not None else [vector_at(problem, near, g) for g in named if near]
    starts = [_best(problem, group, run) for group in (rows, others) if group]
    fits = [solve(problem, theta, iterations=_ITERATIONS, gain=_GAIN, run=run) for theta in starts]
    return min(fits, key=lambda s: s.cost)


def _smaller(name: str, guesses: Sequence[Guess]) -> list[Guess]:
    """Return guesses of a cause with a share of its typical size: a minimum may lie nearer to none at all."""
    if name == NOTHING:
        return []
    main = effect_named(name).main
    if not math.isfinite(main.null) or (main.logarithmic and main.null <= 0.0):
        return []
    return [{**g, main.name: main.null + _SHARE * (g[main.name] - main.null)} for g in guesses]


def repeat_fits(fits: Mapping[str, Solution], run: Map) -> dict[str, Solution]:
    """Return the fits, those that left a little more than the best once more from the rig's values there.

    A fit that began far from the final values of the rig may stop in a local minimum.
    """
    best = min(fits.values(), key=lambda s: s.cost)
    rig = {u.name: float(v) for u, v in zip(best.problem.unknowns, best.theta, strict=True)}
    again = dict(fits)
    for name, fit in fits.items():
        if best.cost + _LITTLE < fit.cost < _CLOSE * best.cost and name != NOTHING:
            theta = np.array(
                [rig.get(u.name, float(v)) for u, v in zip(fit.problem.unknowns, fit.theta, strict=True)]
            )
            other = solve(fit.problem, theta, iterations=_ITERATIONS, gain=_GAIN, run=run)
            again[name] = min(fit, other, key=lambda s: s.cost)
    return again


def _best(problem: Problem, thetas: Sequence[FloatArray], run: Map) -> FloatArray:
    """Return the start of the least cost; fits that begin far off may end in a local minimum."""
    if len(thetas) == 1:
        return thetas[0]
    costs = run(lambda k: np.array([_cost(problem, thetas[k])]), range(len(thetas)))
    return thetas[int(np.argmin([float(c[0]) for c in costs]))]


def _cost(problem: Problem, theta: FloatArray) -> float:
    away = theta - np.array([u.inner(u.start) for u in problem.unknowns])
    return power(problem.residual(theta)) + float(weights_of(problem) @ away**2)
