"""A finding on a joint: a code, the change with size, date and probability."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsea_ros.health.sensors import Sensors


@dataclass(frozen=True)
class HealthFinding:
    """code: of codes.TABLE. name: parameter or channel. size, ci95: change against the model, in `unit`; nan
    where the code has no size. since: s, by the joint's stamps. confidence: probability, 0 to 1.
    """

    code: str
    name: str
    unit: str
    size: float
    ci95: tuple[float, float]
    since: float
    confidence: float


UNEXPLAINED = "RSEA_UNEXPLAINED"


def unexplained_finding(since: float, share: float) -> HealthFinding:
    """Return the finding of a change without a name. share: of it that the best cause does not explain."""
    return HealthFinding(UNEXPLAINED, UNEXPLAINED, "", math.nan, (math.nan, math.nan), since, share)


def sensor_findings(sensors: Sensors, jumps: int, late: int) -> list[HealthFinding]:
    """Return the findings on the sensors themselves. jumps: of the stamps. late: samples left out."""
    findings = [_plain("RSEA_SENSOR_FROZEN", name, since) for name, since in sensors.frozen.items()]
    findings += [_plain("RSEA_SENSOR_MISSING", name, since) for name, since in sensors.missing.items()]
    counts = {"no numbers": sensors.bad_values, "jumps of the stamps": jumps, "late samples": late}
    counted = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    return [*findings, _plain("RSEA_BAD_DATA", counted, math.nan)] if counted else findings


def _plain(code: str, name: str, since: float) -> HealthFinding:
    return HealthFinding(code, name, "", math.nan, (math.nan, math.nan), since, 1.0)
