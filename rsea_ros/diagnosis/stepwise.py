"""Stepwise selection: from the re-fitted nominal model, cause after cause, until only noise is left or no
effect helps.

Models are fitted to the training blocks and chosen on the validation blocks; the test blocks are not touched.
"""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.candidate import (
    Candidate,
    FitSetup,
    fit_candidate,
    leaves_only_noise,
    refit,
    scored_against,
    with_noise_reestimated,
)
from rsea_ros.diagnosis.forward_step import NO_STEP, ForwardStep
from rsea_ros.diagnosis.replacement import replacement_step
from rsea_ros.diagnosis.selection import Selection, Trial, trial_of
from rsea_ros.diagnosis.settings import DiagnosisSettings
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
    setup = FitSetup(nominal.cases, settings.fits, pools.run)
    first = fit_candidate(FitSetup(nominal.cases, settings.fits, pools.run,
                                   iterations=settings.fits.first_iterations),
                          nominal, vector_of(nominal.unknowns, start) if start else None)  # fmt: skip
    models = [refit(with_noise_reestimated(first), setup)]
    trials: list[Trial] = []
    rivals: dict[str, tuple[Candidate, ...]] = {}
    for number in range(settings.max_causes + settings.forward.replacements):
        present, step = models[-1], NO_STEP
        if _is_finished(present, settings):
            break
        forward = ForwardStep(present, effects, number, pools, tell, settings)
        if len(present.causes) < settings.max_causes:
            step = forward.run()
            trials += step.trials
        if step.accepted is None:
            step = replacement_step(forward)
        if step.accepted is None:
            break
        rivals[step.accepted.newest] = step.equals
        trials.append(trial_of(step.accepted, step.accepted.newest, present, "replaced"))
        models.append(refit(with_noise_reestimated(step.accepted), setup))
    cases = models[-1].cases
    return Selection((*(scored_against(m, cases) for m in models[:-1]), models[-1]), tuple(trials), rivals)


def _is_finished(model: Candidate, settings: DiagnosisSettings) -> bool:
    """Tell whether only noise is left; coloured noise may hide a cause that a fit still finds."""
    is_coloured = any(case.coloured for case in model.cases)
    return leaves_only_noise(model, settings.floor.only_noise) and not is_coloured
