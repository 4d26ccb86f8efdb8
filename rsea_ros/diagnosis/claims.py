"""Claims: every accepted cause and every rival of it, as a model that held-out data can be asked about.

Rivals of a cause are the effects that were tried beside the same model and what is said to be confused with
it and does as well in its place; each has a weight by what it leaves of the judging blocks (stacking.py).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rsea_ros.diagnosis.candidate import Model, effect_size
from rsea_ros.diagnosis.criteria import prior_cost
from rsea_ros.diagnosis.data_split import JUDGE, Score, score_on
from rsea_ros.diagnosis.evaluation import Stage, effect_added
from rsea_ros.diagnosis.evidence import Claim
from rsea_ros.diagnosis.stacking import stacked
from rsea_ros.diagnosis.stepwise import GAVE_WAY, Search
from rsea_ros.diagnosis.trial import Trial
from rsea_ros.diagnosis.workers import Workers
from rsea_ros.identification.problem import Case

LEAST_WEIGHT = 0.02
"""Of all that was tried in a cause's place: a rival with less is none."""
MOST_RIVALS = 3


@dataclass(frozen=True)
class Contest:
    """A cause that was accepted and its rivals, the likeliest first."""

    cause: Claim
    rivals: tuple[Claim, ...]


def contests(found: Search, stages: Sequence[Stage], at_work: Workers) -> list[Contest]:
    """Return the contest for the place of each accepted cause, in the order of the stages."""
    result = []
    for without, with_it in itertools.pairwise(stages):
        name = effect_added(with_it)
        last = stages[-1].solution
        claim = Claim(name, last.problem, last.theta, with_it.judged, without.judged, 1.0)
        rounds = [t for t in found.trials if t.name == name and t.why == GAVE_WAY]
        tried = beside(found, rounds[-1].beside) if rounds else []
        result.append(weighed(found, claim, tried, at_work))
    return result


def beside(found: Search, model: Model) -> list[Trial]:
    """Return the trials beside a model that were fitted to everything, each effect's last."""
    full = {t.name: t for t in found.trials if t.is_full and t.beside.causes == model.causes}
    return list(full.values())


def weighed(found: Search, claim: Claim, tried: Sequence[Trial], at_work: Workers) -> Contest:
    """Return a contest of a claim with what was tried beside the same model, or does as well in its place.

    Another cause that was accepted too is no rival, whichever of the two came first.
    """
    cases, last = found.cases, set(found.last.causes)
    tried = [t for t in tried if t.name == claim.name or t.name not in last]
    scores = list(at_work.fits.map(lambda t: trial_score(t, cases), tried))
    weights = _stacked(scores, [prior_cost(t) for t in tried], [effect_size(t.name) for t in tried])
    of = {t.name: w for t, w in zip(tried, weights, strict=True)}
    rivals = [
        Claim(t.name, t.problem, t.theta, s, score_on(t.problem, cases, JUDGE, t.beside.outputs), of[t.name])
        for t, s in zip(tried, scores, strict=True)
        if t.name != claim.name
    ]
    swapped = [m for m in found.rivals_of(claim.name) if len(m.causes) == len(last)]
    own, others = of.get(claim.name, 1.0), _weights_of(found, swapped)
    for model, weight in zip(swapped, others[1:], strict=True):
        rivals.append(_in_place(claim, model, cases, weight))
    heavy = sorted((r for r in rivals if r.weight >= LEAST_WEIGHT), key=lambda r: -r.weight)
    once = {r.name: r for r in reversed(heavy)}
    kept = sorted(once.values(), key=lambda r: -r.weight)[:MOST_RIVALS]
    return Contest(replace(claim, weight=min(own, others[0])), tuple(kept))


def trial_score(trial: Trial, cases: tuple[Case, ...]) -> Score:
    """Return how a trial does on the blocks that judge."""
    problem = replace(trial.problem, cases=cases)
    return score_on(problem, cases, JUDGE, problem.outputs(trial.theta))


def _in_place(claim: Claim, model: Model, cases: tuple[Case, ...], weight: float) -> Claim:
    """Return the claim of another effect that does as well in a cause's place."""
    problem, theta = model.solution.problem, model.solution.theta
    judged = score_on(problem, cases, JUDGE, model.outputs)
    return Claim(model.causes[-1], problem, theta, judged, claim.without, weight)


def _weights_of(found: Search, rivals: Sequence[Model]) -> list[float]:
    """Return the weights of the last model and of those with another effect in a cause's place."""
    models = [found.last, *rivals]
    scores = [score_on(m.solution.problem, found.cases, JUDGE, m.outputs) for m in models]
    return _stacked(scores, [prior_cost(m.solution) for m in models], [m.size for m in models])


def _stacked(scores: Sequence[Score], priors: Sequence[float], sizes: Sequence[int]) -> list[float]:
    """Return weights; every number that describes an effect costs the logarithm of the number of blocks.

    A law that holds another as a special case does as well wherever the other is right (Schwarz, Annals of
    Statistics 6, 1978).
    """
    if not scores:
        return []
    best = min(scores, key=lambda s: float(s.loss(s).sum()))
    losses = [s.loss(best) for s in scores]
    prices = [p + math.log(len(losses[0])) * size for p, size in zip(priors, sizes, strict=True)]
    return [float(w) for w in stacked(losses, prices)]
