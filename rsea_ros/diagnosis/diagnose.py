"""Diagnosis: simulate, compare, hypothesise, fit, judge, until nothing is left or nothing helps."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.checks.faults import check
from rsea_ros.checks.usable import check_diagnosable
from rsea_ros.diagnosis.backward_elimination import eliminate_backwards
from rsea_ros.diagnosis.conclusion import diagnosis_of
from rsea_ros.diagnosis.evaluation import evaluate
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.stepwise import select_stepwise
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.identify import CHANNELS, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.workers import worker_pools
from rsea_ros.model.extent import bounded
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.signals import Record


def diagnose(
    records: Sequence[Record],
    rig: Rig,
    holdout: Record | None = None,
    progress: Progress | None = None,
    settings: DiagnosisSettings | None = None,
) -> Diagnosis:
    """Say where a rig's simulation and the records part, why, and what extending the model gains.

    rig: effects that it states belong to the nominal model; their unknown parameters are fitted with the rig.
    holdout: a record that judges; without it, blocks of the records that took no part in fit or choice.
    settings: what is tried, DiagnosisSettings() by default.
    Raises IdentificationError when the records are too short or do not hold what the rig needs.
    """
    settings = settings or DiagnosisSettings()
    tell = progress or (lambda step, share: None)
    tell("checking the data", 0.0)
    records = [bounded(r) for r in records]
    holdout = bounded(holdout) if holdout is not None else None
    for record in [*records, *([holdout] if holdout is not None else [])]:
        check_diagnosable(record)
    checked = [check(r, rig) for r in records]
    cases = tuple(case_from(c.record, rig, c.masked) for c in checked)
    judging = check(holdout, rig) if holdout is not None else None
    stated = frozenset(e.name for e in rig.effects)
    nominal = Problem(cases, rig, unknowns_of(rig, cases), CHANNELS, stated=stated)
    effects = [e for name, e in catalogue().items() if name not in settings.without]
    with worker_pools() as pools:
        found = select_stepwise(cases, nominal, effects, pools, tell, settings.max_causes)
        tell("looking for a simpler model", 0.9)
        found = eliminate_backwards(found, effects, pools)
        tell("judging", 0.95)
        stages = [evaluate(found, m, judging, rig, pools.run) for m in found.models]
        return diagnosis_of(found, stages, [*checked, *([judging] if judging else [])], records, rig, pools)
