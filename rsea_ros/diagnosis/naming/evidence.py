"""The evidence for a cause and its rivals, from data that took part in no fit.

Computed once for every accepted cause and for rivals that do nearly as well in its place; probability.py
turns it into a probability.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from rsea_ros.diagnosis.criteria import preference
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION
from rsea_ros.diagnosis.naming.contribution import rows_of, weight_by
from rsea_ros.diagnosis.naming.flexible import Flexible, flexible
from rsea_ros.diagnosis.naming.signature import Signature, signature
from rsea_ros.diagnosis.score import Score, gain, score_on
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class Evidence:
    """The evidence of held-out data for one cause.

    gain, gain_low: 1 - RMS(with) / RMS(without) of the channel that it helps most, and the lower end of its
    95 % interval. is_sure: the gain pays for the parameters. weight: of this cause among all effects tried in
    its place, 0 to 1. before: the worst channel's residual over its noise without it, left: what its model
    leaves of the worst channel. at_edge: a parameter is at a bound. siblings: causes beside it.
    """

    name: str
    signature: Signature
    flexible: Flexible | None
    channel: str
    gain: float
    gain_low: float
    is_sure: bool
    weight: float
    before: float
    left: float
    at_edge: bool
    siblings: int


@dataclass(frozen=True)
class Claim:
    """A model in which a cause acts, its score on test blocks, and the score without the cause."""

    name: str
    problem: Problem
    theta: FloatArray
    with_it: Score
    without: Score
    weight: float


def evidence_for(
    claim: Claim, cases: tuple[Case, ...], settings: DiagnosisSettings, run: Map
) -> Evidence | None:
    """Return the evidence for a claim; None where its simulation runs away."""
    everything = replace(claim.problem, cases=cases)
    sets, outputs = (*TRAIN, *VALIDATION, *TEST), everything.outputs(claim.theta)
    weights = score_on(everything, cases, sets, outputs, settings.blocks)
    problem = weight_by(claim.problem, cases, weights)
    rows = rows_of(problem, claim.theta, claim.name, settings, run)
    if rows is None:
        return None
    parameters = sum(u.name.startswith(claim.name + ".") for u in problem.unknowns)
    channel = min(
        claim.without.sums, key=lambda n: claim.with_it.ratio(n) / max(claim.without.ratio(n), 1e-12)
    )
    gained, (low, _) = gain(claim.with_it, claim.without, channel, settings.acceptance.resamples)
    return Evidence(
        name=claim.name,
        signature=signature(rows, settings.evidence),
        flexible=flexible(problem, claim.theta, claim.name, rows, settings),
        channel=channel,
        gain=gained,
        gain_low=low,
        is_sure=preference(claim.with_it, claim.without, parameters, settings.acceptance).sure,
        weight=claim.weight,
        before=claim.without.ratio(claim.without.worst),
        left=weights.ratio(weights.worst),
        at_edge=is_at_edge(problem, claim.theta, claim.name, settings.acceptance.near_bound),
        siblings=len(problem.added) - 1,
    )


def is_at_edge(problem: Problem, theta: FloatArray, name: str, near: float) -> bool:
    """Return whether a parameter of an effect, optional ones apart, lies within a share `near` of a bound."""
    parameters = {f"{name}.{p.name}" for p in effect_named(name).parameters if not p.optional}
    unknowns = zip(problem.unknowns, theta, strict=True)
    return any(u.name in parameters and u.is_near_bound(float(t), near) for u, t in unknowns)
