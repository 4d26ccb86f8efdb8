"""Diagnosis: simulate, compare, hypothesise, fit, judge, until nothing is left or nothing helps."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.backward_elimination import pruned
from rsea_ros.diagnosis.conclusion import conclusion
from rsea_ros.diagnosis.evaluation import Examined, judged
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.diagnosis.stepwise import search
from rsea_ros.diagnosis.weighing import weighed
from rsea_ros.diagnosis.workers import Workers, workers
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.identify import CHANNELS, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
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

    holdout: a record that judges; without it, blocks of the records that took no part in fit or choice.
    settings: what is tried, DiagnosisSettings() by default.
    Raises IdentificationError when the records do not hold what the rig needs.
    """
    with workers() as at_work:
        examined = examine(records, rig, at_work, holdout, progress, settings or DiagnosisSettings())
        (progress or quiet)("weighing the causes", 0.97)
        return conclusion(*weighed(examined, at_work), at_work)


def examine(
    records: Sequence[Record],
    rig: Rig,
    at_work: Workers,
    holdout: Record | None,
    progress: Progress | None,
    settings: DiagnosisSettings,
) -> Examined:
    """Search for causes and judge the models found; arguments as of `diagnose`."""
    tell = progress or quiet
    tell("checking the data", 0.0)
    rig = nominal_rig(rig)
    records = [bounded(r) for r in records]
    holdout = bounded(holdout) if holdout is not None else None
    checked = [check(r, rig) for r in records]
    cases = tuple(case_from(c.record, rig, c.masked) for c in checked)
    judging = check(holdout, rig) if holdout is not None else None
    nominal = Problem(cases, rig, unknowns_of(rig, cases), CHANNELS)
    effects = [e for name, e in catalogue().items() if name not in settings.without]
    found = search(cases, nominal, effects, at_work, tell, settings.max_causes)
    tell("looking for a simpler model", 0.9)
    found = pruned(found, effects, at_work)
    tell("judging", 0.95)
    stages = [judged(found, m, judging, rig, at_work.run) for m in found.models]
    return Examined(found, stages, checked, judging, records, rig)


def quiet(step: str, share: float) -> None:
    """Hear of progress and say nothing."""


def nominal_rig(rig: Rig) -> Rig:
    """Return the rig with only those of its effects whose parameters are all known."""
    known = (e for e in rig.effects if all(f"{e.name}.{p}" in rig.known for p in e.parameters))
    return rig.with_effects(*known)
