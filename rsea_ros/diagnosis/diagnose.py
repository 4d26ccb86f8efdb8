"""Diagnosis: what a rig's simulation gets wrong, by stepwise selection among the effects of the catalogue.

The nominal model is fitted; effects are added one after another, each fitted to the training blocks and
accepted by the validation blocks (criteria.py); redundant ones are taken out again; what stays is reported
with its gain on the test blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.checks.faults import Checked, check
from rsea_ros.checks.usable import check_diagnosable
from rsea_ros.diagnosis.backward_elimination import eliminate_backwards
from rsea_ros.diagnosis.conclusion import diagnosis_of
from rsea_ros.diagnosis.evaluation import evaluate
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.stepwise import select_stepwise
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.confidence import torque_scale
from rsea_ros.identification.identify import CHANNELS, unknowns_of
from rsea_ros.identification.joint_start import joint_start
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.steady import steadied
from rsea_ros.identification.workers import worker_pools
from rsea_ros.model.extent import bounded
from rsea_ros.model.position_loop import commanded
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
    """Find what a rig's simulation gets wrong in records, name the causes, and measure what each gains.

    rig: effects that it states belong to the nominal model; their unknown parameters are fitted with the rig.
    holdout: a record on which the models are tested; without it, the test blocks of the records.
    settings: what is tried and by which numbers, DiagnosisSettings() by default.
    Raises IdentificationError when the records are too short or do not hold what the rig needs.
    """
    settings = settings or DiagnosisSettings()
    tell = progress or (lambda step, share: None)
    tell("checking the data", 0.0)
    records = [bounded(commanded(r, rig)) for r in records]
    holdout = bounded(commanded(holdout, rig)) if holdout is not None else None
    for record in [*records, *([holdout] if holdout is not None else [])]:
        check_diagnosable(record)
    checked, sentences = _steady([check(r, rig) for r in records], rig)
    cases = tuple(case_from(c.record, rig, c.masked) for c in checked)
    tested = _steady([check(holdout, rig)], rig)[0][0] if holdout is not None else None
    stated = frozenset(e.name for e in rig.effects)
    nominal = Problem(cases, rig, unknowns_of(rig, cases), CHANNELS, stated=stated)
    effects = [e for name, e in catalogue().items() if name not in settings.without]
    with worker_pools() as pools:
        start = joint_start(checked[0].record, rig) if rig.loop is not None else None
        selection = select_stepwise(nominal, effects, pools, tell, settings, start)
        tell("looking for a simpler model", 0.9)
        selection = eliminate_backwards(selection, effects, pools, settings)
        tell("evaluating on the test blocks", 0.95)
        stages = [evaluate(selection, m, tested, pools, settings) for m in selection.models]
        every = [*checked, *([tested] if tested else [])]
        result = diagnosis_of(selection, stages, every, records, rig, pools, settings)
    return replace(result, statements=(*sentences, *torque_scale(nominal), *result.statements))


def _steady(checked: Sequence[Checked], rig: Rig) -> tuple[list[Checked], tuple[str, ...]]:
    """Return records on the even clocks that their values agree with, and what was done, in words."""
    steady = steadied([c.record for c in checked], [c.masked for c in checked], rig)
    records = zip(checked, steady.records, strict=True)
    return [replace(c, record=record) for c, record in records], steady.sentences
