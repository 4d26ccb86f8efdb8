"""A recording of one joint as records: strictly read, and with its faults as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from msg_adapters.bags import read_contents
from msg_adapters.decoding import DIAGNOSTICS, mean_temperature
from msg_adapters.reading import record_from
from msg_adapters.tables import import_record
from msg_adapters.topic_map import ROLES
from rsea_ros.errors import RseaError
from rsea_ros.fleet.dated_paths import date_in
from rsea_ros.fleet.joints import MappedJoint
from rsea_ros.records.record import Record

_DATED_NS = 10**17
"""Stamps below (1973) count since a machine's start, not since 1970."""


@dataclass(frozen=True)
class JointRecording:
    """A recording of one joint. lenient: with gaps, repeats and NaN as they were recorded.

    strict: as a fit takes it; raises the error of a recording that it cannot take.
    """

    lenient: Record
    strict: Callable[[], Record]
    temperature: float | None
    time: datetime | None


def read_run(path: Path, url: str, joint: MappedJoint) -> JointRecording:
    """Read a recording. path: on this machine. Raises RseaError for one that cannot be read."""
    if joint.table is not None:
        record = import_record(path, joint.table, joint.index)
        return JointRecording(record, lambda: record, None, time_of(record, url, joint.date))
    topics = joint.topics
    wanted = {DIAGNOSTICS, *(topics.topic(role) for role in ROLES), joint.temperature}
    contents = read_contents(path, wanted)
    record = record_from(contents, url, topics, strict=False)
    return JointRecording(
        record,
        lambda: record_from(contents, url, topics),
        mean_temperature(contents, joint.temperature),
        time_of(record, url, joint.date),
    )


def time_of(record: Record, url: str, date: str) -> datetime | None:
    """Return when a recording began: by its stamps, else by the date in its path, else None."""
    if record.epoch_ns > _DATED_NS:
        return datetime.fromtimestamp(record.epoch_ns // 1000 * 1e-6, timezone.utc)
    return date_in(url, date) if date else None


def is_refused(run: JointRecording) -> RseaError | None:
    """Return why a run cannot be read strictly, None where it can."""
    try:
        run.strict()
    except RseaError as error:
        return error
    return None
