"""Weighing: the evidence for every accepted cause and its rivals.

Rivals of a cause are the effects that were tried beside the same model and its known look-alikes
that do as well in its place. Each has a weight by its residual on the test blocks: pseudo-BMA with the
Bayesian bootstrap,

    w_k = mean over bootstraps of softmax_k(-1/2 (sum_b v_b loss_kb + price_k))

v: Dirichlet weights of the blocks times their number. A rival that is ahead by a few blocks' luck does not
get all the weight, as it would from the sum alone (Yao, Vehtari, Simpson, Gelman, Bayesian Anal. 13, 2018).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rsea_ros.diagnosis.candidate import (
    Candidate,
    FitSetup,
    effect_size,
    fit_candidate,
    is_apart,
    prior_cost,
    without_effect,
)
from rsea_ros.diagnosis.data_split import TRAIN, VALIDATION
from rsea_ros.diagnosis.evaluation import Evaluated, HeldOut, Selection, Trial
from rsea_ros.diagnosis.naming.evidence import Claim, Evidence, evidence_for, is_at_edge
from rsea_ros.diagnosis.score import Score, tempered_loss
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of, is_off_rig
from rsea_ros.identification.solver import Pools, Solution, power
from rsea_ros.identification.unknowns import theta_with
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95


@dataclass(frozen=True)
class Contest:
    """A cause that was accepted and its rivals, the likeliest first."""

    cause: Claim
    rivals: tuple[Claim, ...]


def contests(
    selection: Selection, stages: Sequence[Evaluated], held_out: HeldOut, pools: Pools
) -> list[Contest]:
    """Return the contest for the place of each accepted cause, in the order of the stages."""
    result = []
    for without, with_it in itertools.pairwise(stages):
        name = with_it.added
        last = stages[-1].solution
        claim = Claim(name, last.problem, last.theta, with_it.test, without.test, 1.0)
        rounds = [t for t in selection.trials if t.name == name and t.reason == "replaced"]
        tried = beside(selection, rounds[-1].beside) if rounds else []
        result.append(weigh_rivals(selection, claim, tried, held_out, pools))
    return result


def beside(selection: Selection, model: Candidate) -> list[Trial]:
    """Return the trials beside a model that were fitted to all training blocks, the last of each effect.

    Not those whose size ended at a bound.
    """
    full = {t.name: t for t in selection.trials if t.is_full and t.beside.causes == model.causes}
    return [t for t in full.values() if t.reason != "at_bound"]


def _in_the_open(tried: Sequence[Trial], kept: str, near: float) -> list[Trial]:
    """Return trials without those, one kept apart, that ended at a bound: such a law imitates another."""
    return [t for t in tried if t.name == kept or not is_at_edge(t.problem, t.theta, t.name, near)]


def weigh_rivals(
    selection: Selection, claim: Claim, tried: Sequence[Trial], held_out: HeldOut, pools: Pools
) -> Contest:
    """Return a contest of a claim with the effects tried beside the same model, or as good in its place.

    Another cause that was accepted too is no rival, whichever of the two came first. Where the accepted model
    itself is far from the rig, the rig is doubtful: its values decide between no two causes.
    """
    accepted, settings = selection.last.causes, selection.last.settings
    rule = settings.evidence
    near = settings.acceptance.near_bound
    tried = [t for t in tried if t.name == claim.name or t.name not in accepted]
    tried = _in_the_open(tried, claim.name, near)
    trust = 0.0 if is_off_rig(selection.last.solution) else 1.0
    scores, weights = _race(tried, held_out, pools, settings, trust)
    if sum(w >= rule.close_weight for w in weights) > 1:
        tried = _beside_all_causes(tried, weights, claim, selection, pools)
        tried = _in_the_open(tried, claim.name, near)
        scores, weights = _race(tried, held_out, pools, settings, trust)
    weight_of = {t.name: w for t, w in zip(tried, weights, strict=True)}
    rivals = [
        Claim(t.name, t.problem, t.theta, s, held_out.score_of(t.beside), weight_of[t.name])
        for t, s in zip(tried, scores, strict=True)
        if t.name != claim.name
    ]
    swapped = [m for m in selection.rivals_of(claim.name) if len(m.causes) == len(accepted)]
    models = [selection.last, *swapped]
    tested = [held_out.score_of(m) for m in models]
    priors, lengths = [trust * m.prior_cost for m in models], [m.size for m in models]
    among_swapped = _stack(tested, priors, lengths, settings)
    among_tried = weight_of.get(claim.name, 1.0)
    for model, with_it, weight in zip(swapped, tested[1:], among_swapped[1:], strict=True):
        theta = model.solution.theta
        rivals.append(Claim(model.newest, model.problem, theta, with_it, claim.without, weight))
    heavy = sorted((r for r in rivals if r.weight >= rule.least_weight), key=lambda r: -r.weight)
    once = {r.name: r for r in reversed(heavy)}
    kept = sorted(once.values(), key=lambda r: -r.weight)[: rule.most_rivals]
    return Contest(replace(claim, weight=min(among_tried, among_swapped[0])), tuple(kept))


def _race(
    tried: Sequence[Trial], held_out: HeldOut, pools: Pools, settings: DiagnosisSettings, trust: float
) -> tuple[list[Score], list[float]]:
    """Return the scores of trials and their weights. trust: share of the priors' cost that counts."""
    scores = list(pools.fits.map(lambda t: held_out.score(t.problem, t.theta), tried))
    priors = [trust * prior_cost(t.problem, t.theta) for t in tried]
    return scores, _stack(scores, priors, [effect_size(t.name) for t in tried], settings)


def _beside_all_causes(
    tried: Sequence[Trial], weights: Sequence[float], claim: Claim, selection: Selection, pools: Pools
) -> list[Trial]:
    """Return a cause and the trials of some weight, each fitted to the end beside all the other causes.

    What came later still hid in the residual when these were tried. No larger law that may be a smaller one.
    """
    least = selection.last.settings.evidence.close_weight
    rest, _ = without_effect(claim.problem, claim.theta, claim.name)
    mine = [replace(t, problem=claim.problem, theta=claim.theta) for t in tried if t.name == claim.name]
    close = [
        t for t, w in zip(tried, weights, strict=True)
        if w >= least and t.name != claim.name and is_apart(effect_named(t.name), rest)
    ]  # fmt: skip
    models = list(pools.fits.map(lambda t: _in_place_of(claim, t, selection, pools).solution, close))
    ends = [replace(t, problem=m.problem, theta=m.theta) for t, m in zip(close, models, strict=True)]
    is_more = [effect_size(t.name) > effect_size(claim.name) for t in close]
    nested = [more and may_be_less(m, m.problem.newest) for more, m in zip(is_more, models, strict=True)]
    return [*mine, *(t for t, is_nested in zip(ends, nested, strict=True) if not is_nested)]


def may_be_less(solution: Solution, name: str) -> bool:
    """Return whether a part of a law may be nothing by these data, so that they show a smaller law only."""
    nothing = {
        f"{name}.{p.name}": p.null
        for p in effect_named(name).parameters
        if not (p.optional or p.logarithmic) and p.null not in (p.typical, math.inf)
    }
    doubts = np.sqrt(confidence_of(solution).covariance.diagonal())
    return any(
        u.name in nothing and abs(at - u.inner(nothing[u.name])) < Z95 * doubt
        for u, at, doubt in zip(solution.problem.unknowns, solution.theta, doubts, strict=True)
    )


def _in_place_of(claim: Claim, trial: Trial, selection: Selection, pools: Pools) -> Candidate:
    """Return the last model with a trial's effect in the place of a cause, fitted as those that are tested.

    The steps of the search stop far earlier: nearly equal laws need long fits, the values of one compensate
    for the other.
    """
    settings, last = selection.last.settings, selection.last
    blocks, gain = (*TRAIN, *VALIDATION), settings.fits.final_gain
    setup = FitSetup(selection.cases, settings, pools.run, last.validation, blocks=blocks, gain=gain)
    problem, theta = without_effect(claim.problem, claim.theta, claim.name)
    reached = list(zip(trial.problem.unknowns, trial.theta, strict=True))
    own = [(u, float(at)) for u, at in reached if u.name.startswith(trial.name + ".")]
    (effect,) = (e for e in trial.problem.rig.effects if e.name == trial.name)
    problem = replace(
        problem,
        rig=problem.rig.with_effects(*problem.rig.effects, effect),
        unknowns=(*problem.unknowns, *(u for u, _ in own)),
        newest=trial.name,
    )
    theta = np.array([*theta, *(at for _, at in own)])
    values = {u.name: u.outer(float(at)) for u, at in reached}
    starts, masked = (theta, theta_with(problem.unknowns, theta, values)), setup.mask(problem)
    return fit_candidate(setup, problem, min(starts, key=lambda t: power(masked.residual(t))))


def _stack(
    scores: Sequence[Score], priors: Sequence[float], sizes: Sequence[int], settings: DiagnosisSettings
) -> list[float]:
    """Return weights; each parameter of an effect costs the logarithm of the number of blocks.

    A law that holds another as a special case does as well wherever the other is right (Schwarz, Annals of
    Statistics 6, 1978).
    """
    if not scores:
        return []
    best = min(scores, key=lambda s: float(s.loss(s).sum()))
    losses = [tempered_loss(s, best, settings.floor.far) for s in scores]
    prices = [p + math.log(len(losses[0])) * size for p, size in zip(priors, sizes, strict=True)]
    return [float(w) for w in stacking_weights(losses, prices, settings.acceptance.resamples)]


def stacking_weights(
    losses: Sequence[FloatArray],
    prices: Sequence[float],
    resamples: int = DEFAULT.acceptance.resamples,
) -> FloatArray:
    """Return a weight for each model, shape (k,), summing to 1.

    losses: twice the negative log likelihood of every block, shape (b,) each. prices: of the priors, alike.
    """
    loss = np.array(losses)
    blocks = loss.shape[1]
    draws = np.random.default_rng(0).dirichlet(np.ones(blocks), resamples) * blocks
    evidence = -0.5 * (draws @ loss.T + np.asarray(prices))
    evidence -= evidence.max(axis=1, keepdims=True)
    likely = np.exp(evidence)
    return np.asarray((likely / likely.sum(axis=1, keepdims=True)).mean(axis=0))


@dataclass(frozen=True)
class Weighed:
    """A claim with its evidence."""

    claim: Claim
    evidence: Evidence


@dataclass(frozen=True)
class CauseAndRivals:
    """A cause and its rivals, each with its evidence."""

    cause: Weighed
    rivals: tuple[Weighed, ...]


def weigh(
    selection: Selection,
    stages: Sequence[Evaluated],
    held_out: HeldOut,
    pools: Pools,
    settings: DiagnosisSettings,
) -> list[CauseAndRivals]:
    """Return every accepted cause and its rivals with the evidence for each, in the order of the stages."""
    contested = contests(selection, stages, held_out, pools)
    claims = [c for contest in contested for c in (contest.cause, *contest.rivals)]
    weigh_claim = partial(evidence_for, cases=selection.cases, settings=settings, run=pools.run)
    evidence_by_claim = {id(c): e for c, e in zip(claims, pools.fits.map(weigh_claim, claims), strict=True)}

    def with_evidence(group: Sequence[Claim]) -> tuple[Weighed, ...]:
        return tuple(Weighed(c, e) for c in group if (e := evidence_by_claim[id(c)]) is not None)

    return [
        CauseAndRivals(cause[0], with_evidence(contest.rivals))
        for contest in contested
        if (cause := with_evidence([contest.cause]))
    ]
