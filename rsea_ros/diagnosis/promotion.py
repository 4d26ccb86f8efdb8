"""Promotion: an effect that the search did not accept, and that surely helps on blocks that took no part.

A step of the search asks for a tenth of some channel's residual, far from the floor for more. Where several
small effects overlap none brings so much. What nevertheless surely helps becomes a cause to be weighed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate
from rsea_ros.diagnosis.claims import beside, trial_score
from rsea_ros.diagnosis.criteria import preference
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.evaluation import Evaluated, evaluate
from rsea_ros.diagnosis.score import Score, score_on
from rsea_ros.diagnosis.selection import Selection, Trial
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.problem import Case
from rsea_ros.identification.workers import Pools


def promoted(
    selection: Selection,
    stages: Sequence[Evaluated],
    holdout: Checked | None,
    pools: Pools,
    settings: DiagnosisSettings,
) -> tuple[Selection, list[Evaluated]]:
    """Return the selection and its stages with the effect that helps most, if one surely does."""
    cases, last = selection.cases, selection.last
    tried = [t for t in beside(selection, last) if t.name not in last.causes]
    scores = list(pools.fits.map(lambda t: trial_score(t, cases), tried))
    helpful = [(t, s) for t, s in zip(tried, scores, strict=True) if _helps(t, s, cases)]
    if not helpful:
        return selection, list(stages)
    against = min((s for _, s in helpful), key=lambda s: float(s.loss(s).sum()))
    trial, _ = min(helpful, key=lambda item: float(item[1].loss(against).sum()))
    setup = FitSetup(cases, settings.fits, pools.run, trial.beside.validation)
    model = fit_candidate(setup, trial.problem, trial.theta)
    if model.is_at_bound:
        return selection, list(stages)
    marked = replace(trial, reason="replaced")
    larger = replace(selection, models=(*selection.models, model), trials=(*selection.trials, marked))
    return larger, [*stages, evaluate(larger, model, holdout, pools, settings)]


def _helps(trial: Trial, score: Score, cases: tuple[Case, ...]) -> bool:
    """Tell whether a trial surely does better than the model that it was tried beside."""
    without = score_on(trial.problem, cases, TEST, trial.beside.outputs)
    return preference(score, without, len(trial.theta) - trial.beside.parameters).better
