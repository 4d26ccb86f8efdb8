"""When a trend meets its limit, with an interval."""

from __future__ import annotations

import numpy as np

from rsea_ros.records.normal import Z95
from rsea_ros.trends.course import Course
from rsea_ros.trends.quantities import Dated, level_row, slope_row
from rsea_ros.trends.result import Interval
from rsea_ros.trends.settings import DAY


def time_to_limit(whole: Dated, limit: float) -> Interval | None:
    """Return POSIX s at which the last slope brings the level to a limit; None where it surely does not.

    limit: in units of the scale. The ratio of two normal values has the interval of Fieller (1954); the
    doubt of the dates of the terms comes on top.
    """
    if _ahead(whole.course, limit) is None:
        return None
    parts = [_ahead(c, limit) for pair in whole.moved for c in pair]
    if any(p is None for p in parts):
        return None
    days = whole.interval(lambda course: _ahead(course, limit) or Interval(0.0, 0.0, 0.0))
    last = whole.course.days.t[-1]
    return Interval(*(float(last + d) * DAY for d in days))


def _ahead(course: Course, limit: float) -> Interval | None:
    """Return days from the last one on."""
    r, c = course.regression(), course.regression().covariance
    a, b = level_row(course, float(course.t[-1])), slope_row(course, len(course.terms) - 1)
    level, slope = float(a @ r.coefficients) - limit, float(b @ r.coefficients)
    square = slope**2 - Z95**2 * float(b @ c @ b)
    half = level * slope - Z95**2 * float(a @ c @ b)
    rest = level**2 - Z95**2 * float(a @ c @ a)
    room = half**2 - square * rest
    if square <= 0.0 or room < 0.0 or level * slope > 0.0:
        return None
    ends = sorted((-half + side * float(np.sqrt(room))) / square for side in (-1.0, 1.0))
    return Interval(-level / slope, *ends)
