"""A finding of health: its code, its words, its settings.

Codes are permanent, because fault managers rely on them. A discarded code is never used again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

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


class Code(NamedTuple):
    """A code: its meaning, and the unit of its size (empty without a size)."""

    name: str
    meaning: str
    size: str


TABLE = (
    Code("RSEA_STIFFNESS", "stiffness of the spring changed", "change, N·m/rad"),
    Code(
        "RSEA_FRICTION", "viscous or Coulomb friction of the gear changed",
        "change, N·m·s/rad, N·m, or of the factor of both, 1",
    ),
    Code("RSEA_BACKLASH", "backlash between gear and spring appeared or changed", "change of the gap, rad"),
    Code("RSEA_DELAY", "commands take effect later, or sooner, than before", "change, s"),
    Code("RSEA_FT_GAIN", "calibration of the F/T sensor changed", "change of the gain, 1"),
    Code("RSEA_FT_BIAS", "zero of the F/T sensor moved", "change, N·m"),
    Code("RSEA_TORQUE_CONSTANT", "the motor makes another torque from its current", "change of the gain, 1"),
    Code("RSEA_UNEXPLAINED", "the joint changed, but no single cause of this table explains the change", ""),
    Code("RSEA_SENSOR_FROZEN", "a sensor repeats one value while something else moves", ""),
    Code("RSEA_SENSOR_MISSING", "a sensor that the rig lists has sent nothing for a second", ""),
    Code("RSEA_BAD_DATA", "values that are not numbers, stamps that go back or jump", ""),
)  # fmt: skip
NAMES = tuple(code.name for code in TABLE)


@dataclass(frozen=True)
class WatchSettings:
    """rate: false alarms an hour. every: s between looks. learn: looks that show how the innovations scatter.

    fitted: looks that a cause is fitted to. hold: s, how long a command stays in force.
    """

    rate: float = 1e-3
    every: float = 3.0
    learn: int = 20
    fitted: int = 4
    hold: float = 0.05
