"""Records written as bags: measured runs, and overlays of simulations."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from msg_adapters import cdr
from msg_adapters.contents import Remarks
from msg_adapters.topic_map import AXES, FIELDS, TYPES, TopicMap, sign_and_index
from msg_adapters.writing import BagWriter
from rsea_ros.errors import BagError
from rsea_ros.records.record import FloatArray, IntArray, Record

JOINT = "joint"
LATEST = 2.0**31
"""s since 1970, which the seconds of a header do not reach."""
BATCH = 100_000
"""Messages of a topic that are held at a time, 10 MB of them."""


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
    the samples in the order of the record.
    Raises BagError where the bag cannot be written, for two roles on one topic, and for stamps before 1970
    or after 2038.
    """
    series = [one for record, topics in records for one in _series(record, topics)]
    _check_apart(series)
    notes = [note for record, _ in records for note in record.notes]
    remarks = Remarks(notes, [fault for record, _ in records for fault in record.faults])
    with BagWriter(path, storage, recording=False, remarks=remarks, force=force) as bag:
        kinds = [one.topic for one in series]
        for which, log_times, raws in _in_order(series):
            bag.write_all(kinds, which, log_times, raws)


@dataclass(frozen=True)
class _Series:
    """Messages to come of one topic. stamps, log_times: ns, shape (n,); values: by field, shape (n,)."""

    topics: TopicMap
    role: str
    stamps: IntArray
    log_times: IntArray
    values: Mapping[str, FloatArray]

    @property
    def topic(self) -> tuple[str, str]:
        """Name and message type."""
        return self.topics.topic(self.role), TYPES[self.role]

    def messages(self, part: slice) -> list[bytes]:
        """Return some messages, serialised."""
        values = {field: column[part] for field, column in self.values.items()}
        if "wrench" not in values:
            return cdr.joint_states(self.stamps[part], self.topics.joint or JOINT, **values)
        wrench = np.zeros((len(values["wrench"]), len(AXES)))
        sign, index = sign_and_index(self.topics.axis)
        wrench[:, index] = sign * values["wrench"]
        return cdr.wrenches(self.stamps[part], wrench)


def _check_apart(series: Sequence[_Series]) -> None:
    """Refuse two roles on one topic: no reader could distinguish them. Raises BagError."""
    roles: dict[str, tuple[TopicMap, str]] = {}
    for one in series:
        topic, role = one.topics.topic(one.role), (one.topics, one.role)
        if (other := roles.setdefault(topic, role)) != role:
            raise BagError(f"topic {topic}: is both {other[1]} and {one.role}, expected a topic for each")


def _in_order(series: Sequence[_Series]) -> Iterator[tuple[IntArray, IntArray, list[bytes]]]:
    """Yield the messages of all series by log time, made BATCH of the longest at a time.

    A batch has the index of the series, the log time in ns, each shape (n,), and the content of each message.
    """
    if not series:
        return
    longest = max((one.log_times for one in series), key=len)
    done = [0] * len(series)
    for stop in [*longest[BATCH::BATCH].tolist(), None]:
        ends = [
            len(one.log_times) if stop is None else int(np.searchsorted(one.log_times, stop))
            for one in series
        ]
        parts, done = list(map(slice, done, ends)), ends
        log_times = np.concatenate([one.log_times[part] for one, part in zip(series, parts, strict=True)])
        which = np.repeat(np.arange(len(series)), [part.stop - part.start for part in parts])
        raws = list(chain.from_iterable(one.messages(part) for one, part in zip(series, parts, strict=True)))
        order = np.argsort(log_times, kind="stable")
        if order.size:
            yield which[order], log_times[order], [raws[k] for k in order.tolist()]


def _series(record: Record, topics: TopicMap) -> Iterator[_Series]:
    """Yield the messages of a record; channels of a role that share their stamps share messages."""
    for role, fields in FIELDS.items():
        present = [channel for channel in fields if channel in record and len(record[channel])]
        while present:
            first = present[0]
            t = record[first].t
            together = [channel for channel in present if np.array_equal(record[channel].t, t)]
            present = [channel for channel in present if channel not in together]
            stamps = _stamps(record, first, t)
            values = {fields[channel]: record[channel].y for channel in together}
            yield _Series(topics, role, stamps, np.maximum.accumulate(stamps), values)


def _stamps(record: Record, name: str, t: FloatArray) -> IntArray:
    """Return stamps in ns since 1970. Raises BagError for those that no header can hold."""
    since = 1e-9 * record.epoch_ns + t
    for k in np.flatnonzero(~((since >= 0.0) & (since < LATEST)))[:1]:
        stamp = f"{record.source or 'record'}: {name}: stamp {k} is {since[k]:.6g} s since 1970"
        raise BagError(f"{stamp}, expected 0 to {LATEST:.0f}")
    return record.epoch_ns + np.rint(t * 1e9).astype(np.int64)


def write_overlay(records: Mapping[str, Record], path: str | Path) -> None:
    """Write records by namespace as one bag file. Raises BagError where it cannot be written.

    Stamps before 1970, which no bag can hold as log times, are shifted to begin at 1970.
    """
    first = min(record.epoch_ns + round(1e9 * record.start) for record in records.values())
    moved = [(replace(r, epoch_ns=r.epoch_ns - min(first, 0)), name) for name, r in records.items()]
    write_records([(record, TopicMap(namespace=name)) for record, name in moved], path)
