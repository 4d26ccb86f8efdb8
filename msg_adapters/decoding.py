"""Messages decoded to values; topics inferred; faults that /diagnostics reports; a run's temperature.

The counters count from a node's start; counts from before the recording do not belong to the run.
"""

import math
import struct
from collections.abc import Iterator, Mapping

import numpy as np

from msg_adapters.cdr import SECOND, Block, Walk, blocks
from msg_adapters.contents import Contents, Messages
from msg_adapters.topic_map import FLOAT, FLOATS, TopicMap
from rsea_ros.documents.wording import brief
from rsea_ros.records.record import BoolArray, FloatArray, IntArray

_PADDING = 4
"""Bytes behind a message that the middleware may add, less one."""


class Decoded:
    """Stamps (ns) and values by field, each (n,), with which messages fill the field.

    sound: messages that could be decoded. is_unstamped: whether they have no header.
    """

    def __init__(self, messages: Messages, msgtype: str, fields: tuple[str, ...]) -> None:
        count = len(messages.raw)
        self._messages, self._msgtype = messages, msgtype
        self.is_unstamped = msgtype in (FLOAT, FLOATS)
        self.stamps: IntArray = np.zeros(count, np.int64)
        self.sound: BoolArray = np.zeros(count, bool)
        self.values: dict[str, FloatArray] = {name: np.full(count, np.nan) for name in fields}
        self.filled: dict[str, BoolArray] = {name: np.zeros(count, bool) for name in fields}

    def blocks(self, topic: str, where: str, report: Contents) -> list[Block]:
        """Return the messages by layout, without the damaged ones, which are reported.

        Raises BagError where all are damaged.
        """
        damaged: dict[int, str] = {}
        sorted_blocks = list(blocks(self._messages.raw, self._msgtype, where, damaged))
        _mark_overlong(sorted_blocks, damaged)
        for block in sorted_blocks:
            self.stamps[block.rows] = block.stamps()
            for row in block.rows[block.nanoseconds() >= SECOND].tolist():
                damaged.setdefault(row, "its stamp has more than a second of nanoseconds")
        if damaged:
            first, share = min(damaged), len(damaged) / len(self.stamps)
            detail = f"left out, the first is message {first}: {damaged[first]}"
            report.tell("damaged_messages", topic, detail, len(damaged), "messages", share)
        self.sound[:] = True
        self.sound[list(damaged)] = False
        return sorted_blocks

    def take(self, block: Block, columns: Mapping[str, FloatArray | None]) -> None:
        """Take the columns that a block of messages has."""
        sound = self.sound[block.rows]
        rows = block.rows[sound]
        for name, column in columns.items():
            if column is not None:
                self.values[name][rows] = column[sound]
                self.filled[name][rows] = True

    def tell_empty(self, topic: str, report: Contents) -> None:
        """Report a field that some messages leave empty although they have the other fields."""
        for name, filled in self.filled.items():
            beside = [other for other in self.filled.values() if (other & filled).any()]
            lacking = np.any([other & ~filled for other in beside], axis=0)
            if count := int(np.sum(lacking)):
                detail = f"{name} is empty, first in message {int(np.argmax(lacking))}"
                report.tell("empty_fields", topic, detail, count, "messages", count / len(filled))


def _mark_overlong(blocks_of_topic: list[Block], damaged: dict[int, str]) -> None:
    """Mark messages that go on behind their last field, unless those of the topic all do."""
    surplus = [(block, block.matrix.shape[1] - block.layout.end) for block in blocks_of_topic]
    if all(count >= _PADDING for _, count in surplus):
        return
    for block, count in surplus:
        if count >= _PADDING:
            reason = f"{count} bytes behind its last field, expected none"
            damaged.update(dict.fromkeys(block.rows.tolist(), reason))


def is_inferred(contents: Contents, topics: TopicMap) -> bool:
    """Return whether `ft` is a rig's stiffness times `deflection`: it has that one's frame_id, no sensor's.

    A fit to both would find the very stiffness that was put in.
    """
    frames = [_frame(contents, topics.topic(role)) for role in ("ft", "deflection")]
    return bool(frames[0]) and frames[0] == frames[1]


def _frame(contents: Contents, topic: str) -> str:
    """Return the frame_id of the first message of a topic, empty where it has none."""
    messages = contents.topics.get(topic)
    if messages is None or not messages.raw:
        return ""
    try:
        walk = Walk(messages.raw[0])
        walk.skip(8)  # the stamp of the header, before its frame_id
        return walk.read_text()
    except ValueError:  # damaged; the decoder reports it
        return ""


DIAGNOSTICS = "/diagnostics"
TYPE = "diagnostic_msgs/msg/DiagnosticArray"

COUNTERS: Mapping[str, tuple[str, str]] = {
    "left_out": ("commands_left_out", "commands"),
    "late_commands": ("late_commands", "commands"),
    "unstamped_commands": ("late_commands", "commands"),
    "refused_commands": ("refused_commands", "commands"),
    "limited_commands": ("limited_commands", "commands"),
    "watchdog_trips": ("watchdog_trips", "trips"),
    "desired_watchdog_trips": ("watchdog_trips", "trips"),
    "lost_cycles": ("lost_cycles", "cycles"),
    "failed_reads": ("lost_cycles", "cycles"),
    "failed_writes": ("lost_cycles", "cycles"),
    "lost_messages": ("lost_messages", "messages"),
}
"""By key of a node's status: the kind of fault and its unit."""
OWN = (
    "controller", "diagnose", "driver", "excite", "experiment", "health", "identify", "model", "plant",
    "record", "replay", "watch",
)  # fmt: skip
"""Nodes of this package: other packages have keys of the same names, and other meanings."""
_FAULT, _NONE = "fault", "none"
_START = 1_500_000_000
"""ns after the first message: a node first heard of later than this started during the run, all counts 0."""
_MOST_STATES = 1000
"""Nodes and keys that are followed."""


def is_of_the_run(node: str, namespace: str) -> bool:
    """Return whether a node of /diagnostics is one of this package's in a namespace, or in one above it.

    A part of a node has a name behind it.
    """
    parts = node.strip("/").split("/")
    own = next((k for k, part in enumerate(parts) if part in OWN), -1)
    above = [part for part in namespace.split("/") if part]
    return own >= 0 and parts[:own] == above[:own] and (own > 0 or not above)


def tell_health(contents: Contents, report: Contents, namespace: str) -> None:
    """Add the faults that the nodes of the run have reported: this package's, in its namespace.

    Of a counter its growth counts; a node that restarts begins at 0.
    """
    messages = contents.topics.get(DIAGNOSTICS)
    if messages is None or messages.msgtype != TYPE or not messages.raw:
        return
    begin = min(min(m.log_times) for m in contents.topics.values() if m.raw)
    last: dict[tuple[str, str], int] = {}
    grown: dict[tuple[str, str], int] = {}
    faults, damaged = dict[str, str](), 0
    for log_time, raw in zip(messages.log_times, messages.raw, strict=True):
        try:
            for node, key, text in _values(raw):
                if not is_of_the_run(node, namespace):
                    continue
                if key == _FAULT and text != _NONE:
                    faults.setdefault(node, text)
                at, is_count = (node, key), text.isascii() and text.isdigit() and len(text) < 16
                if key not in COUNTERS or not is_count or (at not in last and len(last) >= _MOST_STATES):
                    continue
                value, before = int(text), last.get(at, 0 if log_time - begin > _START else int(text))
                grown[at] = grown.get(at, 0) + (value - before if value >= before else value)
                last[at] = value
        except ValueError:
            damaged += 1
    for (node, key), size in grown.items():
        if size:
            kind, unit = COUNTERS[key]
            report.tell(kind, brief(node), f"{key} on {DIAGNOSTICS}", size, unit)
    for node, text in faults.items():
        report.tell("device_fault", brief(node), brief(text))
    if damaged:
        share = damaged / len(messages.raw)
        detail = "left out: not a DiagnosticArray"
        report.tell("damaged_messages", DIAGNOSTICS, detail, damaged, "messages", share)


def _values(raw: bytes) -> Iterator[tuple[str, str, str]]:
    """Yield node, key and value of a serialised DiagnosticArray. Raises ValueError for a damaged one."""
    walk = Walk(raw)
    walk.stamp_and_frame()
    for _ in range(walk.count()):
        walk.skip(1)
        node = walk.read_text()
        walk.text()
        walk.text()
        for _ in range(walk.count()):
            yield node, walk.read_text(), walk.read_text()


TEMPERATURE = "sensor_msgs/msg/Temperature"


def mean_temperature(contents: Contents, topic: str) -> float | None:
    """Return the mean of a topic's temperatures, °C; None where none of its messages holds a finite one."""
    messages = contents.topics.get(topic)
    if messages is None or messages.msgtype != TEMPERATURE:
        return None
    values = [value for raw in messages.raw if (value := _temperature(raw)) is not None]
    return sum(values) / len(values) if values else None


def _temperature(raw: bytes) -> float | None:
    try:
        walk = Walk(raw)
        walk.stamp_and_frame()
        first, _ = walk.doubles(1)
    except ValueError:
        return None
    value = float(struct.unpack_from(f"{walk.order}d", raw, first)[0])
    return value if math.isfinite(value) else None
