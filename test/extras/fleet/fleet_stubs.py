"""Joints and a task for tests of the engine: the task returns a row at once, whatever the recording holds."""

from __future__ import annotations

from datetime import datetime, timezone

from rsea_extras.fleet.joints import MappedJoint
from rsea_extras.fleet.store import TaskOutcome
from rsea_extras.fleet.task import Task

MARCH = datetime(2026, 3, 5, tzinfo=timezone.utc)
KNEE = MappedJoint("knee", "name: stub")
HIP = MappedJoint("hip", "name: stub")


def stub_work(task: Task) -> TaskOutcome:
    """Return a row of one parameter at once."""
    values = {"value": 1500.0, "low": 1490.0, "high": 1510.0, "unit": "N m/rad", "identifiable": True}
    stiffness = {"name": "spring.stiffness", **values}
    row = task.row(outcome="done", time=MARCH, parameters=[stiffness], seconds=0.1, peak_memory=1)
    return TaskOutcome(row, {"identification.json": "{}\n"})
