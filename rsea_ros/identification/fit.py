"""The fit: parameters and noise in turn, until neither changes, and its misfit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.scale import Scale
from rsea_ros.identification.clocks import (
    MISFIT,
    RequiredClocks,
    free_clocks,
    required_clocks,
    with_drifts,
    without_needless,
)
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import Case, Problem, weighted_residual
from rsea_ros.identification.solver import Map, Solution, serial, solve
from rsea_ros.identification.start import scale_of
from rsea_ros.identification.unknowns import (
    Unknown,
    clocks,
    idle,
    start_vector,
    unknowns_of_effect,
    unknowns_of_rig,
    vector_of,
)
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import MEASURED, FloatArray


def misfit_ratios(solution: Solution) -> dict[str, float]:
    """Return by channel the RMS of a solution's residual over its noise: 1 where it is at the noise."""
    problem = solution.problem
    return ratios_of(problem, problem.cases, problem.outputs(solution.theta))


def ratios_of(
    problem: Problem, cases: Sequence[Case], outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, float]:
    """Return by channel the RMS of the residual over its noise: 1 where it is at the noise."""
    parts: dict[str, list[FloatArray]] = {}
    for case, out in zip(cases, outputs, strict=True):
        for n in problem.present(case):
            parts.setdefault(n, []).append(weighted_residual(case, out, [n]))
    return {n: float(np.sqrt(np.mean(np.concatenate(p) ** 2))) for n, p in parts.items()}


def reweight(case: Case, ratios: Mapping[str, float]) -> Case:
    """Return a case in which the residual of a channel counts as its noise, where it is larger."""
    return replace(case, noise={n: s * max(1.0, ratios.get(n, 1.0)) for n, s in case.noise.items()})


_REWEIGHTINGS = 3
_OTHER_NOISE = 1.1
"""Ratio of a channel's noise after a fit to that before, from which the fit is repeated."""


def fit(
    cases: Sequence[Case], rig: Rig, run: Map = serial, start: Rig | None = None
) -> tuple[Solution, tuple[Case, ...], RequiredClocks]:
    """Fit the rig's free values, its effects and the clocks that the data require.

    Returns also the cases with their noise, and the result of the clock tests.

    The noise is the one that the first fit's residual shows. Where a channel's residual stays above it the
    weight becomes that residual, as in maximum likelihood with unknown noise. start: a start,
    if the records fit it better than `rig`.
    """
    unknowns = tuple(u for u in unknowns_of(rig, cases) if not u.is_clock)
    problem = Problem(tuple(cases), rig, unknowns, MEASURED)
    solution = solve(problem, _better_start(problem, start, run), run=run)
    outputs = problem.outputs(solution.theta)
    known = _with_noise_of(problem, outputs)
    if _has_changed(problem.cases, known):
        solution = solve(replace(problem, cases=known), solution.theta, run=run)
        outputs = problem.outputs(solution.theta)
        known = _with_noise_of(solution.problem, outputs)
    drifting = with_drifts(solution, run)
    if drifting is not solution:
        solution, problem = drifting, drifting.problem
        outputs = problem.outputs(solution.theta)
        known = _with_noise_of(problem, outputs)
    required = required_clocks(solution, run)
    if required.clocks:
        solution = solve(*free_clocks(solution, required), run=run)
        solution = solve(*without_needless(solution), run=run)
        problem = solution.problem
        outputs = problem.outputs(solution.theta)
        known = _with_noise_of(problem, outputs)
    for _ in range(_REWEIGHTINGS):
        ratios = ratios_of(problem, solution.problem.cases, outputs)
        if max(ratios.values()) < MISFIT:
            break
        cases = tuple(reweight(c, ratios) for c in solution.problem.cases)
        solution = solve(replace(problem, cases=cases), solution.theta, run=run)
        outputs = problem.outputs(solution.theta)
    return solution, known, required


def _with_noise_of(problem: Problem, outputs: Sequence[dict[str, FloatArray]]) -> tuple[Case, ...]:
    """Return the cases with the noise that the residual of simulated outputs shows."""
    ratio = problem.rig["gear.ratio"]
    return tuple(reestimate_noise(c, out, ratio) for c, out in zip(problem.cases, outputs, strict=True))


def _has_changed(before: Sequence[Case], after: Sequence[Case]) -> bool:
    """Return whether the noise of any channel has changed by more than a fit would notice."""
    ratios = [b.noise[n] / a.noise[n] for a, b in zip(before, after, strict=True) for n in a.noise]
    return any(not 1.0 / _OTHER_NOISE < r < _OTHER_NOISE for r in ratios)


def _better_start(problem: Problem, start: Rig | None, run: Map) -> FloatArray:
    """Return the coordinates of `start` where the residual is smaller there than at the rig's own values."""
    stated = start_vector(problem.unknowns)
    if start is None:
        return stated
    other = vector_of(problem.unknowns, start)
    costs = [float(r @ r) for r in run(lambda k: problem.residual((stated, other)[k]), (0, 1))]
    return other if costs[1] < costs[0] else stated


def unknowns_of(rig: Rig, cases: Sequence[Case]) -> tuple[Unknown, ...]:
    """Return all that a fit of these cases may move."""
    channels = sorted({n for case in cases for n in case.measured})
    stated = _stated_effects(rig, cases)
    effects = [unknowns_of_effect(e, start, rig.known | idle(e, rig)) for e, start in stated]
    return (
        *unknowns_of_rig(rig),
        *(u for group in effects for u in group),
        *(clocks(channels, rig) if not is_inverse(rig) else ()),
    )


def _stated_effects(rig: Rig, cases: Sequence[Case]) -> Iterator[tuple[Effect, Mapping[str, float]]]:
    """Yield the effects that a rig states with their parameters; bounds suit the machine and hold these."""
    scale = scale_of(cases, rig) if rig.effects else Scale()
    for e in rig.effects:
        yield effect_named(e.name).at(scale).widen(e.parameters), e.parameters
