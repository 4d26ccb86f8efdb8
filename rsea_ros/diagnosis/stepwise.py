"""Stepwise selection: from the re-fitted nominal model, cause after cause, until only noise is left or no
effect helps.

Models are fitted to the training blocks and chosen on the validation blocks; the test blocks are not touched.

Where no effect helps any more, a cause's place is offered to the more detailed effects that it may be
confused with. The first causes were chosen while the others still hid in the residual: a hardening
spring stands in for a stop, Coulomb friction for Stribeck's. Beside the causes that came later the right one
fits better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.diagnosis.candidate import (
    Candidate,
    FitSetup,
    effect_size,
    fit_candidate,
    leaves_only_noise,
    refit,
    rescore,
    with_noise_reestimated,
)
from rsea_ros.diagnosis.criteria import is_acceptable, is_far_from_floor
from rsea_ros.diagnosis.evaluation import Selection, Trial, trial_of
from rsea_ros.diagnosis.forward_step import NO_STEP, ForwardStep, StepResult
from rsea_ros.diagnosis.problem_variants import without_effect
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.unknowns import vector_of
from rsea_ros.identification.workers import Pools
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress


def select_stepwise(
    nominal: Problem,
    effects: Sequence[Effect],
    pools: Pools,
    tell: Progress,
    settings: DiagnosisSettings,
    start: Rig | None = None,
) -> Selection:
    """Select up to max_causes causes among some effects, the one that explains most first.

    start: a rig whose values the first fit begins with.
    """
    setup = FitSetup(nominal.cases, settings, pools.run)
    models = [_fit_nominal(nominal, setup, start)]
    trials: list[Trial] = []
    rivals: dict[str, tuple[Candidate, ...]] = {}
    for number in range(settings.max_causes + settings.forward.replacements):
        current = models[-1]
        if _is_finished(current):
            break
        forward = ForwardStep(current, effects, number, pools, tell, settings)
        step = forward.run() if len(current.causes) < settings.max_causes else NO_STEP
        trials += step.trials
        if step.accepted is None:
            step = replacement_step(forward)
        if step.accepted is None:
            break
        rivals[step.accepted.newest] = step.equals
        trials.append(trial_of(step.accepted, step.accepted.newest, current, "replaced"))
        models.append(refit(with_noise_reestimated(step.accepted), setup))
    cases = models[-1].cases
    return Selection((*(rescore(m, cases) for m in models[:-1]), models[-1]), tuple(trials), rivals)


def replacement_step(step: ForwardStep) -> StepResult:
    """Return the step to a model with another effect in the place of one cause, where it is acceptable."""
    current, settings = step.current, step.settings
    for name in current.causes if is_far_from_floor(current, settings) else ():
        alike = [e for e in look_alikes(name, step.effects) if e.name not in current.problem.acting]
        rivals = [e for e in alike if effect_size(e.name) > effect_size(name)]
        if not rivals:
            continue
        setup = FitSetup(
            current.cases, settings, step.pools.run, weights=current.validation, is_quick=True
        )
        rest = fit_candidate(setup, *without_effect(current.problem, current.solution.theta, name))
        result = replace(step, current=rest, effects=rivals).run()
        if result.accepted is not None and is_acceptable(result.accepted, current, settings):
            return result
    return NO_STEP


def _fit_nominal(nominal: Problem, setup: FitSetup, start: Rig | None) -> Candidate:
    """Fit the nominal model, and again with the noise that its residual shows."""
    theta = vector_of(nominal.unknowns, start) if start else None
    first = fit_candidate(replace(setup, iterations=setup.settings.fits.first_iterations), nominal, theta)
    return refit(with_noise_reestimated(first), setup)


def _is_finished(model: Candidate) -> bool:
    """Return whether only noise is left; coloured noise may hide a cause that a fit still finds."""
    is_coloured = any(case.coloured for case in model.cases)
    return leaves_only_noise(model, model.settings.floor.only_noise) and not is_coloured
