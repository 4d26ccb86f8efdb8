"""Faults that the nodes published on /diagnostics during a run and that affect its bag.

The counters count from a node's start; counts from before the recording do not belong to the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from msg_adapters.cdr import Walk
from msg_adapters.contents import Contents, Messages
from rsea_ros.documents.wording import brief

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
_FAULT, _NONE = "fault", "none"
_START = 1_500_000_000
"""ns after the first message: a node first heard of later than this started during the run, all counts 0."""
_MOST_STATES = 1000
"""Nodes and keys that are followed."""


@dataclass
class _Counter:
    """Last value, and its growth; a node that restarts begins at 0."""

    last: int
    grown: int

    def take(self, value: int) -> None:
        self.grown += value - self.last if value >= self.last else value
        self.last = value


@dataclass
class _States:
    counters: dict[tuple[str, str], _Counter] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)
    damaged: int = 0

    def take(self, node: str, key: str, text: str, late: bool) -> None:
        if key == _FAULT and text != _NONE:
            self.faults.setdefault(node, text)
        if key not in COUNTERS or not (text.isascii() and text.isdigit() and len(text) < 16):
            return
        known = self.counters.get((node, key))
        if known is not None:
            known.take(int(text))
        elif len(self.counters) < _MOST_STATES:
            self.counters[node, key] = _Counter(int(text), int(text) if late else 0)


def tell_health(contents: Contents, report: Contents) -> None:
    """Add the faults that the nodes of the run have reported."""
    messages = contents.topics.get(DIAGNOSTICS)
    if messages is None or messages.msgtype != TYPE or not messages.raw:
        return
    begin = min(min(m.log_times) for m in contents.topics.values() if m.raw)
    states = _follow(messages, begin)
    for (node, key), counter in states.counters.items():
        if counter.grown:
            kind, unit = COUNTERS[key]
            report.tell(kind, brief(node), f"{key} on {DIAGNOSTICS}", counter.grown, unit)
    for node, text in states.faults.items():
        report.tell("device_fault", brief(node), brief(text))
    if states.damaged:
        detail = "left out: not a DiagnosticArray"
        share = states.damaged / len(messages.raw)
        report.tell("damaged_messages", DIAGNOSTICS, detail, states.damaged, "messages", share)


def _follow(messages: Messages, begin: int) -> _States:
    states = _States()
    for log_time, raw in zip(messages.log_times, messages.raw, strict=True):
        try:
            for node, key, text in _values(raw):
                states.take(node, key, text, late=log_time - begin > _START)
        except ValueError:
            states.damaged += 1
    return states


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
