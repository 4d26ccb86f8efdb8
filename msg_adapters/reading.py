"""Bags to records: topics to channels, header stamps to seconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msg_adapters.bags import BagPath, read_contents
from msg_adapters.cdr import Block, blocks
from msg_adapters.checks import Series, checked
from msg_adapters.contents import Contents, Messages
from msg_adapters.topics import FIELDS, ROLES, TYPES, TopicMap, sign_and_index
from rsea_ros.errors import BagError
from rsea_ros.signals import Channel, FloatArray, IntArray, Record

LATEST = 2**63 - 1
"""The highest stamp in ns that a 64-bit integer holds; a damaged log time may be higher."""


def read_record(
    paths: BagPath | Sequence[BagPath], *, topics: TopicMap | None = None, strict: bool = True
) -> Record:
    """Read one bag, or several files of one run, as a record; other topics are ignored.

    Stamps are those of the message headers; where one is zero, the log time stands in and a note says so.
    strict: refuse what no model can be fitted to (missing command or measurement, NaN, stamps that go
    back); repeated stamps are dropped with a note. Otherwise all samples come as they are.
    Raises BagError with file, topic, field, value and expectation.
    """
    topics = topics or TopicMap()
    source = str(paths) if isinstance(paths, BagPath) else ", ".join(map(str, paths))
    contents = read_contents(paths, {topics.topic(role) for role in ROLES})
    return record_from(contents, source, topics, strict=strict)


def record_from(contents: Contents, source: str, topics: TopicMap, *, strict: bool = True) -> Record:
    """Make a record of serialised messages, wherever they came from; see read_record."""
    _require(source, contents, topics, strict)
    notes = contents.notes
    series: dict[str, Series] = {}
    for role in ROLES:
        messages = contents.topics.get(topics.topic(role))
        if messages is not None and messages.raw:
            series.update(_series(source, role, messages, topics, notes))
    if strict:
        series = {name: checked(one, notes) for name, one in series.items()}
    _require_values(source, series, strict)
    epoch = min(int(one.stamps.min()) for one in series.values())
    channels = {name: Channel(_seconds(one.stamps - epoch), one.values) for name, one in series.items()}
    return Record(channels, source, epoch, tuple(dict.fromkeys(notes)))


def _seconds(nanoseconds: IntArray) -> FloatArray:
    return np.asarray(nanoseconds * 1e-9, np.float64)


def _require(source: str, contents: Contents, topics: TopicMap, strict: bool) -> None:
    """Refuse a bag without the topics that a record needs, or with others' types under their names."""
    filled = set()
    for role in ROLES:
        found = contents.topics.get(topics.topic(role), Messages(TYPES[role]))
        if found.msgtype != TYPES[role]:
            raise BagError(f"{source}: {topics.topic(role)} is {found.msgtype}, expected {TYPES[role]}")
        if found.raw:
            filled.add(role)
    needs = [("torque_command",), ("joint_states", "ft")] if strict else [ROLES]
    for roles in needs:
        if not filled.intersection(roles):
            wanted = " or ".join(topics.topic(role) for role in roles)
            have = ", ".join(f"{name} ({m.msgtype})" for name, m in sorted(contents.topics.items()))
            told = f" ({'; '.join(contents.notes)})" if contents.notes else ""
            raise BagError(
                f"{source}: no message on {wanted}; the bag holds {have or 'no topic at all'}{told}"
            )


def _require_values(source: str, series: dict[str, Series], strict: bool) -> None:
    """Refuse messages whose arrays are empty where values are needed."""
    if strict and "command" not in series:
        raise BagError(f"{source}: the command's messages hold no effort, expected the torque in N m")
    if not set(series) - ({"command", "reference"} if strict else set()):
        raise BagError(f"{source}: the messages hold no values, expected a measurement")


def _series(
    source: str, role: str, messages: Messages, topics: TopicMap, notes: list[str]
) -> dict[str, Series]:
    """Decode one topic: channel -> series. A field that no message fills is left out."""
    where = f"{source}: {topics.topic(role)}"
    stamps = np.zeros(len(messages.raw), np.int64)
    values = {field: np.full(len(stamps), np.nan) for field in FIELDS[role].values()}
    there = {field: np.zeros(len(stamps), bool) for field in values}
    found = list(blocks(messages.raw, TYPES[role], where))
    _one_joint(where, found, topics.joint)
    for block in found:
        stamps[block.rows] = block.stamps()
        for field in values:
            column = _column(block, field, topics)
            if column is not None:
                values[field][block.rows] = column
                there[field][block.rows] = True
    stamps = _with_log_times(where, stamps, messages.log_times, notes)
    series = {}
    for channel, field in FIELDS[role].items():
        one = Series(f"{where} {field}", stamps[there[field]], values[field][there[field]])
        if np.isnan(one.values).all():
            if one.values.size:
                notes.append(f"{one.where}: not a number in every message, taken as not measured")
            continue
        series[channel] = one
    return series


def _one_joint(where: str, found: Sequence[Block], joint: str | None) -> None:
    """Refuse several joints where none is named, and a name that is not there."""
    layouts = [block.layout for block in found if "wrench" not in block.layout.fields]
    names = tuple(dict.fromkeys(name for layout in layouts for name in layout.names))
    count = max([len(names), *(n for layout in layouts for _, n in layout.fields.values())])
    listed = ", ".join(names) or "without names"
    if joint is not None and names and joint not in names:
        raise BagError(f"{where}: no joint {joint!r}, the messages hold {listed}")
    if joint is None and count > 1:
        raise BagError(f"{where}: {count} joints ({listed}), expected one; name it with --joint")


def _column(block: Block, field: str, topics: TopicMap) -> FloatArray | None:
    """Return the field's value of each message, None where these messages do not hold it."""
    if field == "wrench":
        sign, index = sign_and_index(topics.axis)
        return sign * block.field(field)[:, index]
    names = block.layout.names
    if topics.joint is not None and names and topics.joint not in names:
        return None
    index = names.index(topics.joint) if topics.joint in names else 0
    return block.field(field)[:, index] if index < block.layout.fields[field][1] else None


def _with_log_times(where: str, stamps: IntArray, log_times: Sequence[int], notes: list[str]) -> IntArray:
    """Put the log time where the header stamp is zero, which means that nobody set it."""
    unset = [row for row in np.flatnonzero(stamps == 0).tolist() if log_times[row]]
    if unset:
        notes.append(f"{where}: {len(unset)} of {len(stamps)} header stamps are zero, log time taken")
        stamps[unset] = [min(log_times[row], LATEST) for row in unset]
    return stamps
