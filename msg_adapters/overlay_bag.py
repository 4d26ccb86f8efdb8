"""Records side by side in one bag, each under the usual topics in a namespace of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from msg_adapters.records import write_records
from msg_adapters.topic_map import TopicMap
from rsea_ros.records.record import Record


def write_overlay(records: Mapping[str, Record], path: str | Path) -> None:
    """Write records by namespace as one bag file. Raises BagError where it cannot be written.

    Stamps before 1970, which no bag can hold as log times, are shifted to begin at 1970.
    """
    first = min(record.epoch_ns + round(1e9 * record.start) for record in records.values())
    moved = [(replace(r, epoch_ns=r.epoch_ns - min(first, 0)), name) for name, r in records.items()]
    write_records([(record, TopicMap(namespace=name)) for record, name in moved], path)
