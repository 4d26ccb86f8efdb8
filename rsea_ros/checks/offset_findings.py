"""Findings about zeros: an F/T torque or an angle that lies off the rig's at all times."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rsea_ros.checks.expected import Side
from rsea_ros.checks.finding import Finding
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record

_LARGE, _FAR = 1.0, 3.0
"""Times the largest torque of the run: a zero that was never set; an offset that no zero explains."""


def offset_findings(record: Record, compared: Mapping[str, Side]) -> list[Finding]:
    """Return the finding of an F/T torque that lies far from what the rig would give.

    compared: the record beside the rig's simulation, which has the gravity of its loads.
    """
    side = compared.get("ft")
    if side is None or "command" not in record:
        return []
    offset = float(np.median(side.y) - np.median(side.p))
    largest = max(float(np.max(np.abs(record["command"].y))), float(np.max(np.abs(side.p))))
    if abs(offset) <= _LARGE * largest:
        return []
    return [
        Finding(
            "red" if abs(offset) > _FAR * largest else "amber",
            "offset",
            "ft",
            offset,
            "N m",
            expected=f"less than {largest:.3g}, the largest torque of the run",
            detail=f"{abs(offset) / largest:.2g} times that torque at all times",
            remedy="set the sensor's zero, look at its mount, or give the constant in the import map",
        )
    ]


def angle_offset_findings(rig: Rig, compared: Mapping[str, Side]) -> list[Finding]:
    """Return the finding of a position whose whole range lies away from where the rig would be."""
    side = compared.get("position")
    if side is None or rig.zero_unknown("position"):
        return []
    middle, rest = float(np.median(side.y)), float(np.median(side.p))
    if min(abs(middle), abs(middle - rest)) <= float(np.ptp(side.y)):
        return []
    return [
        Finding(
            "red",
            "offset",
            "position",
            middle - rest,
            "rad",
            expected=f"motion about {rest:.3g}, where the rig rests",
            detail=f"all of the motion is about {middle:.4g} rad; fits compare its changes alone",
            remedy="`zero_unknown: true` for position in the rig, or give the constant in the import map",
        )
    ]
