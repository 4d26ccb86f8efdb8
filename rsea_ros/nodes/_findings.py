"""Findings of health as diagnostics, and what is kept of them between runs."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

from rclpy.node import Node

from msg_adapters import BagWriter
from msg_adapters.ros import ERROR, OK, WARN, DiagnosticArray, statuses_message
from rsea_ros.documents.units import with_unit
from rsea_ros.health.health_finding import TABLE, HealthFinding
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._health import STEADY
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.outputs.files import unused_path

SEVERE = ("RSEA_SENSOR_FROZEN", "RSEA_SENSOR_MISSING")
"""Codes whose level is ERROR: nobody must trust what such a sensor says."""
Row = tuple[str, bytes, str, Mapping[str, object]]


class FindingsPublisher:
    """Publishes a status for every code once a second. stamp: converts the seconds of a finding to ns."""

    def __init__(
        self,
        node: Node,
        joint: str,
        findings: Callable[[], Sequence[HealthFinding]],
        stamp: Callable[[float], int],
    ) -> None:
        self._name, self._joint = node.get_fully_qualified_name(), joint
        self._findings, self._stamp = findings, stamp
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", COMMAND)
        node.create_timer(1.0, self.publish, clock=STEADY)

    def publish(self) -> None:
        """Publish now."""
        findings = self._findings()
        rows = [self._row(code.name, [f for f in findings if f.code == code.name]) for code in TABLE]
        self._publisher.publish(statuses_message(time.time_ns(), rows, self._joint))

    def _row(self, code: str, findings: Sequence[HealthFinding]) -> Row:
        name = f"{self._name}: {code}"
        if not findings:
            return name, OK, "no", {"code": code}
        level = ERROR if code in SEVERE else WARN
        values: dict[str, object] = {"code": code}
        for finding in findings:
            prefix = f"{finding.name}." if len(findings) > 1 else ""
            values |= {f"{prefix}{key}": value for key, value in self._values(finding).items()}
        return name, level, "; ".join(sentence(f) for f in findings), values

    def _values(self, finding: HealthFinding) -> dict[str, object]:
        values: dict[str, object] = {"name": finding.name, "confidence": f"{finding.confidence:.3f}"}
        if math.isfinite(finding.size):
            low, high = finding.ci95
            values |= {"size": f"{finding.size:.5g}", "low": f"{low:.5g}", "high": f"{high:.5g}"}
            values["unit"] = finding.unit
        if math.isfinite(finding.since):
            values["since"] = instant(self._stamp(finding.since))
        return values


def sentence(finding: HealthFinding) -> str:
    """Return a finding in a line."""
    if not math.isfinite(finding.size):
        return finding.name or finding.code
    low, high = finding.ci95
    size = with_unit(f"{finding.size:.4g}", finding.unit)
    return f"{finding.name} changed by {size} ({low:.4g} to {high:.4g})"


def instant(stamp: int) -> str:
    """Return a stamp, ns since 1970, as UTC."""
    return datetime.fromtimestamp(stamp / SECOND, timezone.utc).isoformat(timespec="milliseconds")


class Message(NamedTuple):
    """A serialised message. at: ns of its arrival."""

    topic: str
    msgtype: str
    at: int
    raw: bytes


class Ring:
    """The newest messages, bounded by seconds and megabytes."""

    def __init__(self, seconds: float, megabytes: float) -> None:
        self._span, self._most = round(seconds * SECOND), round(megabytes * 1e6)
        self._messages: deque[Message] = deque()
        self.size = 0

    def add(self, topic: str, msgtype: str, at: int, raw: bytes) -> None:
        """Keep a message, and drop those too old or too many."""
        self._messages.append(Message(topic, msgtype, at, raw))
        self.size += len(raw)
        first = self._messages[0]
        while self.size > self._most or abs(at - first.at) > self._span:
            self.size -= len(self._messages.popleft().raw)
            if not self._messages:
                break
            first = self._messages[0]

    def messages(self) -> list[Message]:
        """Return the kept messages."""
        return list(self._messages)


class Keeper:
    """Writes bags in a thread. folder: of the bags; most: that it may hold; after: s from alarm to bag."""

    def __init__(self, ring: Ring, folder: Path, most: int, after: float) -> None:
        self._ring, self._folder, self._most, self._after = ring, folder, most, after
        self._pool = ThreadPoolExecutor(1, "bags")
        self._due: tuple[float, str, int] | None = None
        self._writing: Future[Path] | None = None
        self.last: Path | None = None
        self.trouble = ""

    def ask(self, code: str, since: int) -> None:
        """Request a bag of the memory `after` seconds from now. since: ns, of the change."""
        if self._due is None:
            self._due = (time.monotonic() + self._after, code, since)

    def poll(self) -> Path | None:
        """Begin bags that are due; return the folder of one just completed."""
        if self._writing is not None and self._writing.done():
            done, self._writing = self._writing, None
            if error := done.exception():
                self.trouble = f"no bag kept: {error}"
                return None
            self.last, self.trouble = done.result(), ""
            return self.last
        if self._due is not None and self._writing is None and time.monotonic() >= self._due[0]:
            self._begin()
        return None

    def close(self) -> None:
        """Write requested bags, and end."""
        if self._due is not None and self._writing is None:
            self._begin()
        self._pool.shutdown()

    def _begin(self) -> None:
        assert self._due is not None
        (_, code, since), self._due = self._due, None
        held = len([p for p in self._folder.iterdir() if p.is_dir()]) if self._folder.is_dir() else 0
        if held >= self._most:
            self.trouble = f"no bag kept: {self._folder} holds {held}, expected less than {self._most} (bags)"
            return
        path = unused_path(self._folder / f"{time.strftime('%Y%m%d-%H%M%S')}-{code}")
        self._writing = self._pool.submit(_write, path, self._ring.messages(), since)


def _write(path: Path, messages: Sequence[Message], since: int) -> Path:
    """Write bags `before` and `after` an instant (ns), those that have messages, into a folder."""
    for name, part in (
        ("before", [m for m in messages if m.at < since]),
        ("after", [m for m in messages if m.at >= since]),
    ):
        if part:
            with BagWriter(path / name, recording=False) as bag:
                for message in sorted(part, key=lambda m: m.at):
                    bag.write(message.topic, message.msgtype, message.at, message.raw)
    return path
