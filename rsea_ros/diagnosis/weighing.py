"""Weighing: the evidence for every accepted cause and its rivals, and for one more that surely helps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.claims import contests
from rsea_ros.diagnosis.evaluation import Evaluated, held_out_of
from rsea_ros.diagnosis.evidence import Claim, Evidence, evidence_for
from rsea_ros.diagnosis.promotion import promoted
from rsea_ros.diagnosis.selection import Selection
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.verdict import is_at_floor
from rsea_ros.identification.workers import Pools


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


@dataclass(frozen=True)
class Weighing:
    """The selection and its stages, with one more cause where one surely helps, and the evidence by place."""

    selection: Selection
    stages: list[Evaluated]
    places: list[Place]


def weigh(
    selection: Selection,
    stages: Sequence[Evaluated],
    holdout: Checked | None,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Weighing:
    """Weigh every accepted cause and its rivals, and one more that surely helps where the floor is far.

    holdout: the record that takes the place of the test blocks, where one was given.
    """
    accepted = len(stages)
    if not is_at_floor(stages[-1].test, settings.floor):
        selection, stages = promoted(selection, stages, holdout, pools, settings)
    tested_on = held_out_of(selection, holdout)
    held = contests(selection, stages, tested_on, pools, settings.floor.far)
    claims = [c for contest in held for c in (contest.cause, *contest.rivals)]
    found = pools.fits.map(partial(evidence_for, cases=selection.cases, run=pools.run), claims)
    of = {id(c): e for c, e in zip(claims, found, strict=True)}

    def with_evidence(group: Sequence[Claim]) -> tuple[Weighed, ...]:
        return tuple(Weighed(c, e) for c in group if (e := of[id(c)]) is not None)

    places = [
        Place(cause[0], with_evidence(contest.rivals), is_late=k >= accepted)
        for k, contest in enumerate(held, start=1)
        if (cause := with_evidence([contest.cause]))
    ]
    return Weighing(selection, list(stages), places)
