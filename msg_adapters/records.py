"""Records to bags: the reverse of reading.py."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from msg_adapters import encoding
from msg_adapters.topics import AXES, FIELDS, TYPES, TopicMap, sign_and_index
from msg_adapters.writing import BagWriter
from rsea_ros.signals import FloatArray, IntArray, Record

JOINT = "joint"


def write_record(
    record: Record, path: str | Path, topics: TopicMap | None = None, storage: str = "mcap", *,
    force: bool = False,
) -> None:  # fmt: skip
    """Write one record as a bag (see BagWriter for path, storage and force)."""
    write_records([(record, topics or TopicMap())], path, storage, force=force)


def write_records(
    records: Sequence[tuple[Record, TopicMap]], path: str | Path, storage: str = "mcap", *,
    force: bool = False,
) -> None:  # fmt: skip
    """Write several records into one bag, each under the topics of its own map; all or nothing.

    Log times are the stamps, or the highest stamp so far where a stamp goes back, so that a reader finds
    the samples in the order in which they stand in the record.
    Raises BagError where the bag cannot be written.
    """
    rows: list[tuple[int, str, str, bytes]] = []
    for record, topics in records:
        for role, stamps, messages in _messages(record, topics):
            name, msgtype = topics.topic(role), TYPES[role]
            log_times = np.maximum.accumulate(stamps).tolist()
            rows += [(at, name, msgtype, raw) for at, raw in zip(log_times, messages, strict=True)]
    rows.sort(key=lambda row: row[0])
    notes = [note for record, _ in records for note in record.notes]
    with BagWriter(path, storage, recording=False, notes=notes, force=force) as bag:
        for log_time, name, msgtype, raw in rows:
            bag.write(name, msgtype, log_time, raw)


def _messages(record: Record, topics: TopicMap) -> Iterator[tuple[str, IntArray, list[bytes]]]:
    """Yield role, stamps (ns) and messages; channels of a role that share their stamps share messages."""
    for role, fields in FIELDS.items():
        there = [channel for channel in fields if channel in record and len(record[channel])]
        while there:
            t = record[there[0]].t
            together = [channel for channel in there if np.array_equal(record[channel].t, t)]
            there = [channel for channel in there if channel not in together]
            stamps = record.epoch_ns + np.rint(t * 1e9).astype(np.int64)
            values = {fields[channel]: record[channel].y for channel in together}
            yield role, stamps, _encoded(stamps, values, topics)


def _encoded(stamps: IntArray, values: Mapping[str, FloatArray], topics: TopicMap) -> list[bytes]:
    if "wrench" not in values:
        return encoding.joint_states(stamps, topics.joint or JOINT, **values)
    wrench = np.zeros((len(stamps), len(AXES)))
    sign, index = sign_and_index(topics.axis)
    wrench[:, index] = sign * values["wrench"]
    return encoding.wrenches(stamps, wrench)
