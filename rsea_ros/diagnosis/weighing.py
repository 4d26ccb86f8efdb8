"""Weighing: the evidence for every accepted cause and its rivals, and for one more that surely helps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from rsea_ros.diagnosis.claims import contests
from rsea_ros.diagnosis.evaluation import Examined
from rsea_ros.diagnosis.evidence import Claim, Evidence, evidence_for
from rsea_ros.diagnosis.promotion import promoted
from rsea_ros.diagnosis.verdict import reached
from rsea_ros.diagnosis.workers import Workers


@dataclass(frozen=True)
class Weighed:
    """A claim with its evidence."""

    claim: Claim
    evidence: Evidence


@dataclass(frozen=True)
class Place:
    """A cause and its rivals, each with its evidence. is_late: the steps of the search had left it out."""

    cause: Weighed
    rivals: tuple[Weighed, ...]
    is_late: bool = False


def weighed(examined: Examined, at_work: Workers) -> tuple[Examined, list[Place]]:
    """Return what was examined, with one more cause where one surely helps, and the evidence by place."""
    found, stages = examined.found, examined.stages
    if not reached(stages[-1].judged):
        found, stages = promoted(found, stages, examined.judging, examined.rig, at_work)
    held = contests(found, stages, at_work)
    claims = [c for contest in held for c in (contest.cause, *contest.rivals)]
    weigh = partial(evidence_for, cases=found.cases, run=at_work.run)
    of = {id(c): e for c, e in zip(claims, at_work.fits.map(weigh, claims), strict=True)}

    def with_evidence(group: Sequence[Claim]) -> list[Weighed]:
        return [Weighed(c, e) for c in group if (e := of[id(c)]) is not None]

    places = []
    for k, contest in enumerate(held, start=1):
        cause = with_evidence([contest.cause])
        if cause:
            is_late = k >= len(examined.stages)
            places.append(Place(cause[0], tuple(with_evidence(contest.rivals)), is_late))
    return replace(examined, found=found, stages=stages), places
