"""The one table of codes that `health` puts on /diagnostics; docs/health.md repeats it, and a test compares.

Codes are permanent, because fault managers rely on them. A discarded code is never used again.
"""

from __future__ import annotations

from typing import NamedTuple


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
