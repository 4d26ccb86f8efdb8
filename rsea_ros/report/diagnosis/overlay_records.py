"""Measured and simulated records side by side, for tools that show topics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.identification.result import Overlay
from rsea_ros.records.record import Channel, Record

MEASURED, BEFORE, AFTER = "/rsea", "/rsea/simulated_before", "/rsea/simulated_after"
"""Namespaces of the three sets of topics in overlay.mcap."""


def overlay_records(diagnosis: Diagnosis, record: Record) -> Mapping[str, Record]:
    """Return by namespace the record as it was read, and both simulations of its channels.

    record: the first one diagnosed. Simulations have the stamps that the diagnosis used, which are the
    record's own but for repaired faults of the clock.
    """
    return {
        MEASURED: record,
        BEFORE: _simulated_record(record, diagnosis.before),
        AFTER: _simulated_record(record, diagnosis.after),
    }


def _simulated_record(record: Record, overlays: Sequence[Overlay]) -> Record:
    channels = {o.channel: Channel(o.t, o.simulated) for o in overlays}
    return Record(channels, record.source, record.epoch_ns)
