"""The fits of a forward step: effects screened cheaply, fitted on short pieces, then on all training blocks.

Screening tries every effect of the catalogue on the residual, generously. From each initial guess one
simulation and one derivative for each of the effect's parameters; the nominal values change too, by the
derivatives that are already known. Two such steps show what a full fit would gain. A mode is too sharp for
that, and so is a guess that moves the nominal values: these need new derivatives, and more steps.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsea_ros.diagnosis import candidate
from rsea_ros.diagnosis.candidate import Candidate, FitSetup
from rsea_ros.diagnosis.criteria import is_equally_good, is_far_from_floor
from rsea_ros.diagnosis.data_split import short_pieces_of
from rsea_ros.diagnosis.initial_guess import initial_guesses, stated_starts, view_for
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.guess import Guess
from rsea_ros.effects.signal_table import ROTOR_ANGLE
from rsea_ros.errors import RseaError
from rsea_ros.identification.confidence import is_off_rig
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.problem import Problem, with_unknown_start
from rsea_ros.identification.solver import Pools, Solution, bounded_step, jacobian_columns, power, solve
from rsea_ros.identification.unknowns import apply, start_vector, theta_with
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import FloatArray

_DAMPING = 1e-6
"""Of the curvature: keeps apart what the data do not. Numerical: far below that of any unknown that shows."""
_STEPS, _PART = 2, 0.3
"""Steps of an effect's screening, with old derivatives, and the share of one that is tried where the whole
one does not lower the cost."""
_SMALLER = 0.1
"""Share of a first guess that is tried where two linear steps from it led uphill: a tenth of a typical size
is nearly linear; without it mild effects were lost."""
QUICK_FIT = 6
"""Steps of an effect's first fit to all training blocks."""
_MOVED = 0.02
"""Change of what a channel leaves, from which a fit is repeated."""


@dataclass(frozen=True)
class ScreenedEffect:
    """An effect beside the current model, with the start of a full fit and the cost already reached."""

    effect: Effect
    problem: Problem
    theta: FloatArray
    cost: float

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def screen(
    current: Solution, effect: Effect, guesses: Sequence[dict[str, float]]
) -> ScreenedEffect | None:
    """Return the best of an effect's guesses after two cheap steps; None for an effect the rig cannot have.

    A guess may also name values of the rig: these then differ from where the derivatives were taken.
    """
    best = _best_of(current, effect, guesses)
    if best is None or best.cost >= current.cost:
        second = _best_of(current, effect, _other_guesses(effect, guesses))
        best = min((b for b in (best, second) if b is not None), key=lambda b: b.cost, default=None)
    return best


def _other_guesses(effect: Effect, guesses: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """Return guesses of a tenth of their size, where an effect is nearly linear; none without a null size.

    A mode's main parameter, its frequency, is no size: where the peaks of the residual do not show one, its
    typical values are tried.
    """
    main = effect.main
    if "mode" in effect.tags:
        return [dict(effect.typical)] if guesses else []
    if not math.isfinite(main.null):
        return []
    sized = [guess for guess in guesses if main.name in guess]
    return [{**guess, main.name: main.null + _SMALLER * (guess[main.name] - main.null)} for guess in sized]


def _best_of(
    current: Solution, effect: Effect, guesses: Iterable[Mapping[str, float]]
) -> ScreenedEffect | None:
    """Return the best of some guesses."""
    tried_all = []
    for guess in guesses:
        parameters = {name: value for name, value in guess.items() if "." not in name}
        base = with_values(current, {name: value for name, value in guess.items() if "." in name})
        is_bent = "mode" in effect.tags or base is not current
        try_guess = _with_new_derivatives if is_bent else _with_present_derivatives
        try:
            tried = try_guess(base, effect, parameters)
        except RseaError:
            continue
        if tried is not None:
            tried_all.append(tried)
    return min(tried_all, key=lambda s: s.cost, default=None)


def with_values(current: Solution, values: Mapping[str, float]) -> Solution:
    """Return a solution with some of its unknowns at other values; itself when none of them differs."""
    theta = theta_with(current.problem.unknowns, current.theta, values)
    return current if (theta == current.theta).all() else replace(current, theta=theta)


def _with_new_derivatives(
    current: Solution, effect: Effect, guess: dict[str, float]
) -> ScreenedEffect:
    problem, theta = add_effect(current.problem, current.theta, effect, guess)
    solution = solve(problem, theta, iterations=_STEPS)
    return ScreenedEffect(effect, solution.problem, solution.theta, solution.cost)


def _with_present_derivatives(
    current: Solution, effect: Effect, guess: dict[str, float]
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
    for _ in range(_STEPS):
        better = step.take(best, residual)
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

    def take(self, start: ScreenedEffect, residual: FloatArray) -> tuple[ScreenedEffect, FloatArray] | None:
        """Return the end of a step, or of a share of it, and its residual; None where none helps."""
        slope = self._matrix.T @ residual + self._prior**2 * (start.theta - self._centre)
        aim = bounded_step(self._problem, start.theta, self._normal, slope)
        for share in (1.0, _PART):
            theta = start.theta + share * (aim - start.theta)
            stepped = self._problem.residual(theta)
            cost = self.cost(theta, stepped)
            if cost < start.cost:
                return replace(start, theta=theta, cost=cost), stepped
        return None


@dataclass(frozen=True)
class StepFits:
    """Fits effects beside the current model, as cheaply as each stage of a forward step allows.

    say: called with the current fit and the share of the step that is done.
    """

    current: Candidate
    effects: Sequence[Effect]
    pools: Pools
    settings: DiagnosisSettings
    say: Callable[[str, float], None]

    @property
    def is_far(self) -> bool:
        """Whether the current model is far from the noise floor."""
        return is_far_from_floor(self.current, self.settings)

    @cached_property
    def on_pieces(self) -> Solution:
        """The current model fitted to short pieces; far from the floor with clocks taken as right.

        Near it the clocks stay: without them whatever shifts the response beats the effect that is missing.
        """
        weighted = candidate.in_units_of(self.current.validation, self.current.cases)
        runs = zip(weighted, self.current.outputs, strict=True)
        cases = tuple(p for case, out in runs for p in short_pieces_of(case, out, self.settings))
        solution = self.current.solution
        problem, theta = replace(solution.problem, cases=cases), solution.theta
        if self.is_far:
            problem, theta = candidate.without_clocks(candidate.with_doubled_step(problem), theta)
        problem = with_unknown_start(problem, theta)
        return solve(problem, theta, iterations=5)

    @cached_property
    def guesses(self) -> dict[str, list[Guess]]:
        """The initial guesses of every effect that is not in the model."""
        solution = self.current.solution
        rig, _ = apply(solution.problem.rig, solution.problem.unknowns, solution.theta)
        cases, outputs = self.current.cases, self.current.outputs
        effects = [e for e in self.effects if e.name not in solution.problem.acting]
        guesses = self.pools.fits.map(lambda e: initial_guesses(e, view_for(e, cases, rig, outputs)), effects)
        return {e.name: g for e, g in zip(effects, guesses, strict=True)}

    def screen(self, solution: Solution) -> list[ScreenedEffect]:
        """Return every other effect after two cheap steps beside a solution, best first."""
        model = solution.problem
        effects = [e for e in self.effects if e.name not in model.acting and candidate.is_apart(e, model)]
        guesses = self.guesses

        def try_effect(i: int) -> ScreenedEffect | None:
            self.say(effects[i].name, 0.4 * i / len(effects))
            return screen(solution, effects[i], guesses[effects[i].name])

        screened = [s for s in self.pools.fits.map(try_effect, range(len(effects))) if s is not None]
        return sorted(screened, key=lambda s: s.cost)

    def with_typical(self, screened: ScreenedEffect) -> Solution:
        """Return the current model on the pieces with an effect of typical size, not fitted."""
        base, effect = self.on_pieces, screened.effect
        return solve(*add_effect(base.problem, base.theta, effect, dict(effect.typical)), iterations=0)

    def fit_pieces(self, screened: Iterable[ScreenedEffect]) -> list[ScreenedEffect]:
        """Fit screened effects to the short pieces."""
        return list(self.pools.fits.map(self._fit_pieces, screened))

    def fit_all(self, screened: Iterable[ScreenedEffect]) -> list[Candidate]:
        """Fit screened effects to all training blocks."""
        return list(self.pools.fits.map(self._fit_all, screened))

    def on_measured_angle(self) -> list[Candidate]:
        """Return models with an effect of the rotor's angle, simulated on the measured angle.

        A free simulation of a high gear ratio may settle in other detents. But the measured
        angle contains the motion by every other cause, so such a model counts only where it leaves
        little: otherwise it imitates another missing effect. None without a measured position.
        """
        base = self.on_pieces
        if any(isinstance(c.drive, Drive) and not len(c.drive.angle) for c in base.problem.cases):
            return []
        on_angle = replace(base, problem=replace(base.problem, on_angle=True))
        effects = [e for e in self.effects if ROTOR_ANGLE in e.reads and e.name not in base.problem.acting]
        screened = (screen(on_angle, e, self.guesses[e.name]) for e in effects)
        fitted = [self._fit_pieces(s) for s in screened if s is not None]
        models = [self._fit_all(s) for s in fitted if s.cost < 0.5 * base.cost]
        return [m for m in models if not is_far_from_floor(m, self.settings)]

    def complete(self, screened: ScreenedEffect) -> tuple[Problem, FloatArray]:
        """Return the problem of a screened effect on every sample, clocks included, and its theta."""
        problem = replace(screened.problem, cases=self.current.cases)
        theta = screened.theta
        if self.is_far:
            problem, theta = candidate.with_clocks(problem, theta, self.current.problem)
        return problem, theta

    def _fit_pieces(self, screened: ScreenedEffect) -> ScreenedEffect:
        self.say(f"fitting {screened.name}", 0.5)
        starts = [screened.theta, *self._from_stated_values(screened)]
        ends = [solve(screened.problem, start) for start in starts]
        best = min(ends, key=lambda s: s.cost)
        return replace(screened, theta=best.theta, cost=best.cost)

    def _from_stated_values(self, screened: ScreenedEffect) -> list[FloatArray]:
        """Return where the best of an effect's starts at the rig's values leads in a few steps.

        None where the current model keeps these values.
        """
        if not is_off_rig(self.on_pieces):
            return []
        starts = stated_starts(screened.problem, screened.theta, screened.effect)
        tried = [solve(screened.problem, start, iterations=_STEPS) for start in starts]
        return [min(tried, key=lambda s: s.cost).theta]

    def _fit_all(self, screened: ScreenedEffect) -> Candidate:
        self.say(f"fitting {screened.name} to all training blocks", 0.8)
        problem, theta = self.complete(screened)
        masked = self._setup.mask(problem)
        start = min(self._starts(problem, theta), key=lambda t: power(masked.residual(t)))
        return self._fit_from(problem, start)

    def _fit_from(self, problem: Problem, start: FloatArray) -> Candidate:
        """Fit to all training blocks, and again in units of what that leaves."""
        first = candidate.fit_candidate(self._setup, problem, start)
        if problem.on_angle:
            on_current = replace(problem, on_angle=False)
            free = candidate.fit_candidate(self._setup, on_current, first.solution.theta)
            first = free if is_equally_good(free, first, self.settings) else first
        if not self._has_moved(first):
            return first
        is_quick = is_far_from_floor(first, self.settings)
        return candidate.refit(first, replace(self._setup, iterations=FitSetup.iterations, is_quick=is_quick))

    @property
    def _setup(self) -> FitSetup:
        """How effects are fitted beside the current model."""
        return FitSetup(
            self.current.cases, self.settings, self.pools.run, self.current.validation,
            iterations=QUICK_FIT, is_quick=self.is_far,
        )  # fmt: skip

    def _starts(self, problem: Problem, theta: FloatArray) -> list[FloatArray]:
        """Return the starts of a full fit: from the pieces, or from the current model beside the effect.

        The pieces were fitted without clocks, whose part other values have taken on the pieces.
        """
        names = [u.name for u in self.current.problem.unknowns]
        values = dict(zip(names, self.current.solution.theta, strict=True))
        mixed = [values.get(u.name, float(t)) for u, t in zip(problem.unknowns, theta, strict=True)]
        return [theta, np.array(mixed)]

    def _has_moved(self, model: Candidate) -> bool:
        """Return whether a model leaves much more or less of a channel than the current one, its weight."""
        scores, channels = (model.validation, self.current.validation), model.validation.sums
        now, before = (np.array([max(s.ratio(n), 1.0) for n in channels]) for s in scores)
        return bool(np.any(np.abs(now / before - 1.0) > _MOVED))
