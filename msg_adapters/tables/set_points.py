"""Tables of set points: static calibrations, whose rows are readings at rest and no times."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from rsea_ros.documents.units import plain
from rsea_ros.records.record import UNITS, Record

SET_POINTS = (
    "static readings, without the commands, one a second in the bag: `identify` and `diagnose` need the"
    " record of a motion; a stiffness found here goes into its rig"
)
_ORDER = ("deflection", "position", "command", "motor_torque", "ft")
"""A channel over those before it."""
_FEWEST, _NORMAL = 4, 1.96


def static_lines(record: Record) -> Iterator[str]:
    """Yield the line through each two channels of readings at rest, y = slope x + offset, with 95 %.

    Of ft over deflection the slope is the spring's stiffness. Source: ordinary least squares.
    """
    for x, y in combinations([name for name in _ORDER if name in record], 2):
        at, readings = record[x], record[y]
        if len(at) != len(readings) or len(at) < _FEWEST or np.ptp(at.y) == 0.0:
            continue
        (slope, offset), covariance = np.polyfit(at.y, readings.y, 1, cov=True)
        off = float(np.abs(readings.y - slope * at.y - offset).max())
        unit, per = plain(UNITS[y]), plain(UNITS[x])
        ratio = "" if unit == per else f" {unit}/{per}"
        half = _NORMAL * float(covariance[0, 0]) ** 0.5
        yield (
            f"{y} over {x}: {slope:.6g} ± {half:.2g}{ratio}, {offset:.3g} {unit} at zero,"
            f" readings up to {off:.2g} {unit} off the line"
        )
