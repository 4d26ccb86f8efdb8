"""Screening: every effect of the catalogue tried on the residual, cheaply and generously.

From each initial guess one simulation and one derivative for each of the effect's parameters; the nominal
values change too, by the derivatives that are already known. Two such steps show what a full fit would gain.
A mode is too sharp for that, and so is a guess that moves the nominal values: these need new derivatives, and
more steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.settings import ForwardSettings
from rsea_ros.effects.effect import Effect
from rsea_ros.errors import RseaError
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution, bounded_step, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import start_vector, theta_with
from rsea_ros.records.record import FloatArray

_DAMPING = 1e-6
"""Of the curvature: keeps apart what the data do not. Numerical: far below that of any unknown that shows."""


@dataclass(frozen=True)
class ScreenedEffect:
    """An effect beside the current model, with the start of a full fit and the cost already reached.

    unsure: the best of its guesses whose derivatives change on the way, as far as two steps led, which does
    not show where a fit leads.
    """

    effect: Effect
    problem: Problem
    theta: FloatArray
    cost: float
    unsure: tuple[ScreenedEffect, ...] = ()

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def screen(
    current: Solution, effect: Effect, guesses: Sequence[dict[str, float]], rule: ForwardSettings
) -> ScreenedEffect | None:
    """Return the best of an effect's guesses after two cheap steps; None for an effect the rig cannot have.

    A guess may also name values of the rig: these then differ from where the derivatives were taken.
    """
    best = _best_of(current, effect, guesses, rule)
    if best is None or best.cost >= current.cost:
        second = _best_of(current, effect, _other_guesses(effect, guesses, rule.smaller_guess), rule)
        best = min((b for b in (best, second) if b is not None), key=lambda b: b.cost, default=None)
    return best


def _other_guesses(
    effect: Effect, guesses: Sequence[Mapping[str, float]], share: float
) -> list[dict[str, float]]:
    """Return guesses of a share of their size, where an effect is nearly linear; none without a null size.

    A mode's main parameter, its frequency, is no size: where the peaks of the residual do not show one, its
    typical values are tried.
    """
    main = effect.main
    if "mode" in effect.tags:
        return [dict(effect.typical)] if guesses else []
    if not math.isfinite(main.null):
        return []
    sized = [guess for guess in guesses if main.name in guess]
    return [{**guess, main.name: main.null + share * (guess[main.name] - main.null)} for guess in sized]


def _best_of(
    current: Solution, effect: Effect, guesses: Iterable[Mapping[str, float]], rule: ForwardSettings
) -> ScreenedEffect | None:
    """Return the best of some guesses."""
    tried_all, unsure = [], []
    for guess in guesses:
        parameters = {name: value for name, value in guess.items() if "." not in name}
        base = with_values(current, {name: value for name, value in guess.items() if "." in name})
        is_bent = "mode" in effect.tags or base is not current
        try_guess = _with_new_derivatives if is_bent else _with_present_derivatives
        try:
            tried = try_guess(base, effect, parameters, rule)
        except RseaError:
            continue
        if tried is not None:
            tried_all.append(tried)
            unsure += [tried] if is_bent and 0.0 < tried.cost < math.inf else []
    best = min(tried_all, key=lambda s: s.cost, default=None)
    apart = {round(math.log(s.cost), 3): s for s in reversed(unsure)}
    least = tuple(apart[k] for k in sorted(apart)[: rule.bent_guesses])
    return None if best is None else replace(best, unsure=least)


def best_guess(
    current: Solution, effect: Effect, guesses: Iterable[dict[str, float]], rule: ForwardSettings
) -> ScreenedEffect | None:
    """Return the best of some guesses after two steps with the derivatives that are known.

    None for an effect that shows in no channel.
    """
    tried = (_with_present_derivatives(current, effect, guess, rule) for guess in guesses)
    return min((t for t in tried if t is not None), key=lambda s: s.cost, default=None)


def continue_fit(screened: ScreenedEffect, rule: ForwardSettings) -> ScreenedEffect:
    """Return the best of an effect's guesses after more steps of those that were unsure."""
    longer = [solve(s.problem, s.theta, iterations=rule.bent_steps) for s in screened.unsure]
    ends = [ScreenedEffect(screened.effect, s.problem, s.theta, s.cost) for s in longer]
    return min([screened, *ends], key=lambda s: s.cost)


def with_values(current: Solution, values: Mapping[str, float]) -> Solution:
    """Return a solution with some of its unknowns at other values; itself when none of them differs."""
    theta = theta_with(current.problem.unknowns, current.theta, values)
    return current if (theta == current.theta).all() else replace(current, theta=theta)


def _with_new_derivatives(
    current: Solution, effect: Effect, guess: dict[str, float], rule: ForwardSettings
) -> ScreenedEffect:
    problem, theta = add_effect(current.problem, current.theta, effect, guess)
    solution = solve(problem, theta, iterations=rule.screening_steps)
    return ScreenedEffect(effect, solution.problem, solution.theta, solution.cost)


def _with_present_derivatives(
    current: Solution, effect: Effect, guess: dict[str, float], rule: ForwardSettings
) -> ScreenedEffect | None:
    """Return where two steps lead; None for an effect that shows in no channel, or that runs away."""
    problem, theta = add_effect(current.problem, current.theta, effect, guess)
    residual = problem.residual(theta)
    if power(residual) == np.inf:
        return None
    columns = jacobian_columns(problem, theta, residual, range(len(current.theta), len(theta)))
    if not columns.any():
        return None
    step = _Step(problem, np.column_stack([current.jacobian, columns]))
    best = ScreenedEffect(effect, problem, theta, step.cost(theta, residual))
    for _ in range(rule.screening_steps):
        better = step.take(best, residual, (1.0, rule.screening_part))
        if better is None:
            break
        best, residual = better
    return best


class _Step:
    """Damped Gauss-Newton steps of a problem with derivatives that are not taken again."""

    def __init__(self, problem: Problem, matrix: FloatArray) -> None:
        self._problem, self._matrix = problem, matrix
        self._prior = np.array([1.0 / u.doubt for u in problem.unknowns])
        self._centre = start_vector(problem.unknowns)
        normal = matrix.T @ matrix + np.diag(self._prior**2)
        self._normal = normal + np.diag(_DAMPING * np.diag(normal) + 1e-12)

    def cost(self, theta: FloatArray, residual: FloatArray) -> float:
        """Return the squared residual plus the cost of leaving the priors."""
        return power(residual) + float(np.sum((self._prior * (theta - self._centre)) ** 2))

    def take(
        self, start: ScreenedEffect, residual: FloatArray, shares: Sequence[float]
    ) -> tuple[ScreenedEffect, FloatArray] | None:
        """Return the end of a step, or of a share of it, and its residual; None where none helps."""
        slope = self._matrix.T @ residual + self._prior**2 * (start.theta - self._centre)
        aim = bounded_step(self._problem, start.theta, self._normal, slope)
        for share in shares:
            theta = start.theta + share * (aim - start.theta)
            stepped = self._problem.residual(theta)
            cost = self.cost(theta, stepped)
            if cost < start.cost:
                return replace(start, theta=theta, cost=cost), stepped
        return None
