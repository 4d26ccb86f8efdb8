"""The verdict of the diagnosis on all records of a session, restricted to the session's causes."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

SHORTEST = 4.2
"""s of a record, rest included, that the diagnosis takes."""


def diagnose_together(
    records: Sequence[Record], rig: Rig, causes: Sequence[str], tell: Progress | None = None
) -> Diagnosis:
    """Return the diagnosis of all records together, which weighs causes by held-out data."""
    others = tuple(name for name in catalogue() if name not in causes)
    return diagnose(list(records), rig, None, tell, DiagnosisSettings(without=others))
