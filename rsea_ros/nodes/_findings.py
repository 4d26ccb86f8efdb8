"""Findings of a joint's health as statuses on /diagnostics, one for each code, whether it holds or not."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone

from rclpy.node import Node

from msg_adapters.ros import ERROR, OK, WARN, DiagnosticArray, statuses_message
from rsea_ros.documents.units import with_unit
from rsea_ros.health.health_finding import TABLE, HealthFinding
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._health import STEADY
from rsea_ros.nodes._qos import COMMAND

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
