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

from rsea_ros.diagnosis import candidate
from rsea_ros.diagnosis.candidate import Candidate, FitSetup
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

_CLOSE, _LEAST, _MOST = 1e-6, 0.02, 3
"""Weights in a race from which an effect is fitted to the end (27 in twice the log likelihood, which the last
steps of a long fit were seen to bring) and is a rival; rivals that are weighed."""


def contests(
    selection: Selection, stages: Sequence[Evaluated], held_out: HeldOut, pools: Pools
) -> list[list[Claim]]:
    """Return each accepted cause and its rivals, the likeliest first, in the order of the stages."""
    last = stages[-1].solution
    claims = [
        Claim(with_it.added, last.problem, last.theta, with_it.test, without.test, 1.0)
        for without, with_it in itertools.pairwise(stages)
    ]
    return [weigh_rivals(selection, claim, held_out, pools) for claim in claims]


def weigh_rivals(selection: Selection, claim: Claim, held_out: HeldOut, pools: Pools) -> list[Claim]:
    """Return a cause and its rivals, weighed beside all the other causes.

    Another cause that was accepted too is no rival, whichever of the two came first. Where the accepted model
    itself is far from the rig, the rig is doubtful: its values decide between no two causes.
    """
    settings = selection.last.settings
    near = settings.acceptance.near_bound
    trust = 0.0 if is_off_rig(selection.last.solution) else 1.0

    def race(tried: Sequence[Trial]) -> tuple[list[Trial], list[Score], list[float]]:
        """Return trials whose size ended at no bound, where a law imitates another; scores and weights."""
        runs = [t for t in tried if t.name == claim.name or not is_at_edge(t.problem, t.theta, t.name, near)]
        scores = list(pools.fits.map(lambda t: held_out.score(t.problem, t.theta), runs))
        priors = [trust * candidate.prior_cost(t.problem, t.theta) for t in runs]
        return runs, scores, _stack(scores, priors, [candidate.effect_size(t.name) for t in runs], settings)

    mine = Trial(claim.name, selection.last, claim.problem, claim.theta, True, "replaced")
    close = dict[str, Trial]()
    for tried in (_of_its_step(selection, claim), [mine, *selection.contenders.get(claim.name, ())]):
        runs, _, weights = race(tried)
        close |= {t.name: t for t, w in zip(runs, weights, strict=True) if w >= _CLOSE}
    close = {name: t for name, t in close.items() if name not in selection.last.causes}
    runs, scores, weights = race([mine, *_beside_all_causes(list(close.values()), claim, selection, pools)])
    claims = [
        Claim(t.name, t.problem, t.theta, score, held_out.score_of(t.beside), weight)
        for t, score, weight in zip(runs[1:], scores[1:], weights[1:], strict=True)
        if weight >= _LEAST
    ]
    heaviest = sorted(claims, key=lambda c: -c.weight)[: _MOST]
    return [replace(claim, weight=weights[0]), *heaviest]


def _of_its_step(selection: Selection, claim: Claim) -> list[Trial]:
    """Return the trials beside the model to which a cause was added, fitted to all training blocks.

    The last of each effect, and none whose size ended at a bound.
    """
    steps = [t.beside for t in selection.trials if t.name == claim.name and t.reason == "replaced"]
    full = {
        t.name: t for t in selection.trials
        if steps and t.is_full and t.beside.causes == steps[-1].causes
    }  # fmt: skip
    return [t for t in full.values() if t.reason != "at_bound"]


def _beside_all_causes(
    tried: Sequence[Trial], claim: Claim, selection: Selection, pools: Pools
) -> list[Trial]:
    """Return trials fitted to the end in the place of a cause, beside all the other causes.

    What came later still hid in the residual when these were tried. No larger law that may be a smaller one.
    """
    rest, _ = candidate.without_effect(claim.problem, claim.theta, claim.name)
    apart = [t for t in tried if candidate.is_apart(effect_named(t.name), rest)]
    ends = pools.fits.map(lambda t: _in_place_of(claim, t, selection, pools).solution, apart)
    return [
        replace(t, problem=end.problem, theta=end.theta)
        for t, end in zip(apart, ends, strict=True)
        if candidate.effect_size(t.name) <= candidate.effect_size(claim.name) or not may_be_less(end, t.name)
    ]


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
    seen, gain = (*TRAIN, *VALIDATION), candidate.LAST_GAIN
    setup = FitSetup(selection.cases, settings, pools.run, last.validation, blocks=seen, gain=gain)
    problem, theta = candidate.without_effect(claim.problem, claim.theta, claim.name)
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
    return candidate.fit_candidate(setup, problem, min(starts, key=lambda t: power(masked.residual(t))))


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
    losses: Sequence[FloatArray], prices: Sequence[float], resamples: int = DEFAULT.acceptance.resamples
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


def weigh(
    selection: Selection, stages: Sequence[Evaluated], held_out: HeldOut, pools: Pools,
    settings: DiagnosisSettings,
) -> list[list[Weighed]]:  # fmt: skip
    """Return every accepted cause and behind it its rivals, each with its evidence, stage after stage."""
    contested = contests(selection, stages, held_out, pools)
    claims = list(itertools.chain.from_iterable(contested))
    weigh_claim = partial(evidence_for, cases=selection.cases, settings=settings, run=pools.run)
    evidence_by_claim = {id(c): e for c, e in zip(claims, pools.fits.map(weigh_claim, claims), strict=True)}

    known = ([(c, evidence_by_claim[id(c)]) for c in group] for group in contested)
    return [[Weighed(c, e) for c, e in place if e is not None] for place in known if place[0][1] is not None]
