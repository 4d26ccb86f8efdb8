"""Records side by side in one bag, each with the contract's topics in a namespace of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msg_adapters.records import write_records
from msg_adapters.topics import TopicMap
from rsea_ros.signals import Record


def write_overlay(records: Mapping[str, Record], path: str | Path) -> None:
    """Write records by namespace as one bag file. Raises BagError where it cannot be written."""
    write_records([(record, TopicMap(namespace=namespace)) for namespace, record in records.items()], path)
