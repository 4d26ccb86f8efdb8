"""The estimates with a simple law added that the rig does not list.

Where the model does not fit, the missing law biases its estimates, and no covariance of the
residual shows that: a motor constant 10 % off moves K_s by 11 % while K_s seems known to 0.01 %. So each of a
few laws that a bench often has is added in turn and fitted with everything else. One that takes away part of
the misfit is credible, and its estimates widen the intervals (model averaging, Buckland et al. 1997, in its
most careful form: the span). Only the diagnosis decides which law it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.errors import RseaError
from rsea_ros.identification.confidence import Confidence, confidence_of, interval
from rsea_ros.identification.fit import misfit_ratios, reweight
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, Solution, solve
from rsea_ros.identification.start import scale_of
from rsea_ros.identification.unknowns import idle, start_vector, unknowns_of_effect, with_effect
from rsea_ros.identification.workers import Pools
from rsea_ros.model.inverse import is_inverse
from rsea_ros.records.record import FloatArray

LAWS = ("torque_constant_error", "command_delay", "current_loop_lag", "coulomb_friction", "ft_gain_error")
"""What is wrong most often and biases the values of the rig most, one number each."""
FALL = 0.1
"""Of the cost: an alternative that takes away less explains nothing of the misfit."""
NEAR = 2.0
"""Times the cost of the best alternative, up to which another is credible beside it."""
_ITERATIONS = 10


@dataclass(frozen=True)
class ExtendedFit:
    """A law that the rig does not list, and the fit with it."""

    name: str
    solution: Solution
    confidence: Confidence

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of an unknown, SI."""
        unknowns = self.solution.problem.unknowns
        i = [u.name for u in unknowns].index(name)
        sd = float(np.sqrt(self.confidence.covariance[i, i]))
        return interval(unknowns[i], float(self.solution.theta[i]), sd)


def add_effect(
    present: Problem, theta: FloatArray, effect: Effect, start: dict[str, float]
) -> tuple[Problem, FloatArray]:
    """Return the present problem with one more effect whose parameters may move, and its start."""
    unknowns = (*present.unknowns, *unknowns_of_effect(effect, start, idle(effect, present.rig)))
    rig = with_effect(present.rig, effect.name, start)
    problem = replace(present, rig=rig, unknowns=unknowns, newest=effect.name)
    return problem, np.concatenate([theta, start_vector(problem.unknowns)[len(theta) :]])


def alternatives(solution: Solution, cases: Sequence[Case], pools: Pools) -> tuple[ExtendedFit, ...]:
    """Return the laws that would explain a part of a solution's residual, the best first.

    cases: with the noise of their sensors, not with weights from the misfit.
    """
    problem = solution.problem
    if is_inverse(problem.rig):
        return ()
    acting, scale = {e.name for e in problem.rig.effects}, scale_of(problem.cases, problem.rig)
    names = [n for n in LAWS if n not in acting]
    tried = pools.fits.map(lambda n: _fit_with(solution, effect_named(n).at(scale), pools.run), names)
    fitted = [(n, s) for n, s in zip(names, tried, strict=True) if s is not None]
    fitted = [(n, s) for n, s in fitted if s.cost < (1.0 - FALL) * solution.cost]
    best = min((s.cost for _, s in fitted), default=0.0)
    credible = sorted(((n, s) for n, s in fitted if s.cost <= NEAR * best), key=lambda item: item[1].cost)
    return tuple(pools.fits.map(lambda law: _refit(law[0], law[1], cases, pools.run), credible))


def _fit_with(solution: Solution, effect: Effect, run: Map) -> Solution | None:
    """Return the fit with one more effect; None where the rig cannot have it."""
    try:
        problem_and_start = add_effect(solution.problem, _clocks_at_zero(solution), effect, effect.typical)
        return solve(*problem_and_start, iterations=_ITERATIONS, run=run)
    except RseaError:
        return None


def _clocks_at_zero(solution: Solution) -> FloatArray:
    """Return where a solution ended with its clocks right: beside a misfit they run to their bounds."""
    clocks = np.array([u.is_clock for u in solution.problem.unknowns])
    return np.where(clocks, 0.0, solution.theta)


def _refit(name: str, solution: Solution, cases: Sequence[Case], run: Map) -> ExtendedFit:
    """Return an alternative fitted again, every channel in units of its residual or its noise."""
    known = replace(solution.problem, cases=tuple(cases))
    ratios = misfit_ratios(replace(solution, problem=known))
    weighted = tuple(reweight(case, ratios) for case in cases)
    settled = solve(replace(known, cases=weighted), solution.theta, iterations=_ITERATIONS, run=run)
    return ExtendedFit(name, settled, confidence_of(settled, run))


def span_all(ci95: tuple[float, float], name: str, others: Sequence[ExtendedFit]) -> tuple[float, float]:
    """Return an interval of a parameter widened to hold its intervals under the alternatives, SI."""
    every = [ci95, *(other.interval(name) for other in others)]
    return min(low for low, _ in every), max(high for _, high in every)
