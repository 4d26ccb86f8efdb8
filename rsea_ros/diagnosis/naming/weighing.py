"""Weighing: the evidence for every accepted cause and its rivals, and for one more that surely helps.

A step of the search requires that the residual of some channel falls by `acceptance.fall`, and by more far
from the floor. Where several small effects overlap, none may gain that much. An effect that nevertheless
surely helps on unused blocks is promoted to a cause to be weighed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate
from rsea_ros.diagnosis.criteria import is_at_floor, preference
from rsea_ros.diagnosis.evaluation import Evaluated, HeldOut, Selection, Trial, evaluate, held_out_data
from rsea_ros.diagnosis.naming.evidence import Claim, Evidence, evidence_for
from rsea_ros.diagnosis.naming.rivals import beside, contests
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.workers import Pools


@dataclass(frozen=True)
class Weighed:
    """A claim with its evidence."""

    claim: Claim
    evidence: Evidence


@dataclass(frozen=True)
class CauseAndRivals:
    """A cause and its rivals, each with its evidence. is_late: the search had left it out."""

    cause: Weighed
    rivals: tuple[Weighed, ...]
    is_late: bool = False


@dataclass(frozen=True)
class Weighing:
    """The selection and its stages, with one more cause where one surely helps, and the evidence by place."""

    selection: Selection
    stages: list[Evaluated]
    places: list[CauseAndRivals]


def weigh(
    selection: Selection,
    stages: Sequence[Evaluated],
    held_out: HeldOut,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Weighing:
    """Weigh every accepted cause and its rivals, and one more that surely helps where the floor is far."""
    accepted = len(stages)
    if not is_at_floor(stages[-1].test, settings.floor):
        selection, stages = promote_best(selection, stages, held_out, pools, settings)
    contested = contests(selection, stages, held_out, pools)
    claims = [c for contest in contested for c in (contest.cause, *contest.rivals)]
    weigh_claim = partial(evidence_for, cases=selection.cases, settings=settings, run=pools.run)
    evidence_by_claim = {id(c): e for c, e in zip(claims, pools.fits.map(weigh_claim, claims), strict=True)}

    def with_evidence(group: Sequence[Claim]) -> tuple[Weighed, ...]:
        return tuple(Weighed(c, e) for c in group if (e := evidence_by_claim[id(c)]) is not None)

    places = [
        CauseAndRivals(cause[0], with_evidence(contest.rivals), is_late=k >= accepted)
        for k, contest in enumerate(contested, start=1)
        if (cause := with_evidence([contest.cause]))
    ]
    return Weighing(selection, list(stages), places)


def promote_best(
    selection: Selection,
    stages: Sequence[Evaluated],
    held_out: HeldOut,
    pools: Pools,
    settings: DiagnosisSettings,
) -> tuple[Selection, list[Evaluated]]:
    """Return the selection and its stages with the effect that helps most, if one surely does."""
    test_blocks, last = held_out_data(selection, None), selection.last
    tried = [t for t in beside(selection, last) if t.name not in last.causes]
    scores = list(pools.fits.map(lambda t: test_blocks.score(t.problem, t.theta), tried))
    helpful = [(t, s) for t, s in zip(tried, scores, strict=True) if _helps(t, s, test_blocks)]
    if not helpful:
        return selection, list(stages)
    against = min((s for _, s in helpful), key=lambda s: float(s.loss(s).sum()))
    trial, _ = min(helpful, key=lambda item: float(item[1].loss(against).sum()))
    setup = FitSetup(selection.cases, settings, pools.run, trial.beside.validation)
    model = fit_candidate(setup, trial.problem, trial.theta)
    if model.is_at_bound:
        return selection, list(stages)
    marked = replace(trial, reason="replaced")
    larger = replace(selection, models=(*selection.models, model), trials=(*selection.trials, marked))
    return larger, [*stages, evaluate(larger, model, held_out, pools, settings)]


def _helps(trial: Trial, score: Score, test_blocks: HeldOut) -> bool:
    """Return whether a trial surely does better than the model that it was tried beside."""
    extra, rule = len(trial.theta) - trial.beside.parameters, trial.beside.settings.acceptance
    return preference(score, test_blocks.score_of(trial.beside), extra, rule).better
