"""Promotion: an effect that the search did not accept, and that surely helps on blocks that took no part.

A step of the search asks for a tenth of some channel's residual, far from the floor for more. Where several
small effects overlap none brings so much. What nevertheless surely helps becomes a cause to be weighed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.candidate import fitted
from rsea_ros.diagnosis.claims import beside, trial_score
from rsea_ros.diagnosis.criteria import at_bound
from rsea_ros.diagnosis.data_split import JUDGE, Score, score_on
from rsea_ros.diagnosis.evaluation import Stage, judged
from rsea_ros.diagnosis.judge import compare
from rsea_ros.diagnosis.stepwise import GAVE_WAY, Search
from rsea_ros.diagnosis.trial import Trial
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.model.rig import Rig


def promoted(
    found: Search, stages: Sequence[Stage], judging: Checked | None, rig: Rig, at_work: Workers
) -> tuple[Search, list[Stage]]:
    """Return the search and its stages with the effect that helps most, if one surely does."""
    tried = [t for t in beside(found, found.last) if t.name not in found.last.causes]
    scores = list(at_work.fits.map(lambda t: trial_score(t, found.cases), tried))
    helpful = [(t, s) for t, s in zip(tried, scores, strict=True) if _helps(t, s, found)]
    if not helpful:
        return found, list(stages)
    against = min((s for _, s in helpful), key=lambda s: float(s.loss(s).sum()))
    trial, _ = min(helpful, key=lambda item: float(item[1].loss(against).sum()))
    weights, run = trial.beside.choose, at_work.run
    model = fitted(found.cases, trial.problem, trial.theta, weights=weights, run=run)
    if at_bound(model.solution):
        return found, list(stages)
    marked = replace(trial, why=GAVE_WAY)
    larger = replace(found, models=(*found.models, model), trials=(*found.trials, marked))
    return larger, [*stages, judged(larger, model, judging, rig, run)]


def _helps(trial: Trial, score: Score, found: Search) -> bool:
    """Tell whether a trial surely does better than the model that it was tried beside."""
    without = score_on(trial.problem, found.cases, JUDGE, trial.beside.outputs)
    extra = len(trial.theta) - trial.beside.parameters
    return compare(score, without, extra).better
