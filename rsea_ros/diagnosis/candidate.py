"""A model of the search: fitted on some blocks of the cases, scored on others, in units of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rsea_ros.diagnosis.data_split import CHOOSE, FIT, Score, part, score_on
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.noise_level import ABOVE, reestimate_noise
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, Solution, serial, solve
from rsea_ros.model.drive import Drive, coarser
from rsea_ros.signals import FloatArray

AT_FLOOR = ABOVE
"""RMS of the residual over the noise, in every channel, below which there is nothing left to explain."""
DELAY = "command_delay.delay"
_ITERATIONS = 12
_SEARCH_GAIN = 2e-4
"""Relative fall of the cost below which a fit of the search is done; what is judged is fitted further."""
_FARTHEST = 20.0
"""RMS of the residual over the noise up to which a gain grows with it: there small falls mean nothing."""


@dataclass(frozen=True)
class Model:
    """A fitted model, its simulated channels on every case, and how it does on the blocks that choose."""

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    choose: Score

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects that act, in the order in which they came in."""
        return tuple(e.name for e in self.solution.problem.rig.effects)

    @property
    def size(self) -> int:
        """How many numbers describe the effects, optional ones not counted."""
        return sum(effect_size(name) for name in self.causes)

    @property
    def parameters(self) -> int:
        """How many unknowns the model has."""
        return len(self.solution.theta)


def effect_size(name: str) -> int:
    """Return how many numbers describe an effect, optional ones not counted."""
    return sum(not p.optional for p in effect_named(name).parameters)


def fitted(
    cases: Sequence[Case],
    problem: Problem,
    theta: FloatArray | None,
    places: tuple[int, ...] = FIT,
    iterations: int = _ITERATIONS,
    weights: Score | None = None,
    gain: float = _SEARCH_GAIN,
    near: Solution | None = None,
    run: Map = serial,
    quick: bool = False,
) -> Model:
    """Fit a problem's unknowns on some blocks of the cases. weights: a score whose misfit counts as noise.

    gain: relative fall of the cost below which the fit is done, at the noise; farther off it grows.
    near: a solution on the same blocks, with other noise, whose derivatives the fit begins with.
    run: how derivatives are made, one after another or in a pool. quick: on coarser steps.
    """
    masked = on_places(problem, cases, places, weights)
    masked = quicker(masked) if quick else masked
    fit = partial(solve, masked, iterations=iterations, gain=gain * _distance(weights), run=run)
    solution = fit(theta, matrix=None if near is None else _reweighted(near, masked))
    moved = with_common_clock_in_delay(solution)
    if moved is not None:
        solution = min(solution, fit(moved), key=lambda s: s.cost)
    return as_model(cases, solution)


def _distance(weights: Score | None) -> float:
    """Return the RMS of a residual over the noise in its worst channel, at least 1."""
    ratios = [] if weights is None else [weights.ratio(n) for n in weights.sums]
    return min(max([1.0, *ratios]), _FARTHEST)


def on_places(
    problem: Problem, cases: Sequence[Case], places: tuple[int, ...], weights: Score | None
) -> Problem:
    """Return a problem on some blocks of the cases. weights: a score whose misfit counts as noise."""
    return replace(problem, cases=tuple(heavier(part(c, places), weights) for c in cases))


def quicker(problem: Problem) -> Problem:
    """Return a problem on steps twice as long: for what is far from the floor, half the cost."""
    return replace(
        problem,
        cases=tuple(
            replace(c, drive=coarser(c.drive)) if isinstance(c.drive, Drive) else c for c in problem.cases
        ),
    )


def _reweighted(solution: Solution, problem: Problem) -> FloatArray:
    """Return the derivatives of a solution in units of the noise of another problem on the same samples."""
    new, old = (p.by_row(lambda case, n: case.noise[n]) for p in (problem, solution.problem))
    result: FloatArray = solution.jacobian * (old / new)[:, None]
    return result


def with_common_clock_in_delay(solution: Solution) -> FloatArray | None:
    """Return theta with the clock error that all sensors share turned into delay of the command.

    Where a delay is a whole number of samples the residual has a kink, and a fit may stop there with the
    rest in the clocks. None for a model without a delay.
    """
    names = [u.name for u in solution.problem.unknowns]
    clocks = [i for i, u in enumerate(solution.problem.unknowns) if u.is_clock and not u.is_rate]
    if DELAY not in names or not clocks:
        return None
    theta = solution.theta.copy()
    common = float(np.mean(theta[clocks]))
    theta[clocks] -= common
    theta[names.index(DELAY)] -= common
    return np.asarray(theta)


def heavier(case: Case, weights: Score | None) -> Case:
    """Return a case in which what a model leaves of a channel counts as its noise, where that is more."""
    if weights is None:
        return case
    noise = {n: s * max(1.0, weights.ratio(n)) if n in weights.sums else s for n, s in case.noise.items()}
    return replace(case, noise=noise)


def as_model(cases: Sequence[Case], solution: Solution) -> Model:
    """Return a solution with its outputs and its score on the blocks that choose."""
    outputs = solution.problem.outputs(solution.theta)
    return Model(solution, outputs, score_on(solution.problem, cases, CHOOSE, outputs))


def refitted(cases: Sequence[Case], model: Model, run: Map, quick: bool = False) -> Model:
    """Fit a model again with each channel in units of what the model leaves of it."""
    there = model.solution
    weights = rescored(cases, model).choose
    return fitted(cases, there.problem, there.theta, weights=weights, near=there, run=run, quick=quick)


def rescored(cases: Sequence[Case], model: Model) -> Model:
    """Return the model with its score against the cases' present noise."""
    problem = replace(model.solution.problem, cases=tuple(part(c, FIT) for c in cases))
    return Model(
        replace(model.solution, problem=problem, jacobian=_reweighted(model.solution, problem)),
        model.outputs,
        score_on(problem, cases, CHOOSE, model.outputs),
    )


def reestimated(cases: Sequence[Case], model: Model) -> tuple[Case, ...]:
    """Return the cases with the noise that a model's residual shows."""
    ratio = model.solution.problem.rig["gear.ratio"]
    return tuple(reestimate_noise(c, out, ratio) for c, out in zip(cases, model.outputs, strict=True))


def at_floor(model: Model, cases: Sequence[Case]) -> bool:
    """Tell whether the residual of every channel is noise, on all blocks but those that judge."""
    standing = score_on(model.solution.problem, cases, (*FIT, *CHOOSE), model.outputs)
    return standing.missed == 0.0 and all(standing.ratio(n) < AT_FLOOR for n in standing.sums)
