"""Which joint to look at first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.settings import DEFAULT, TrendSettings

_BASE = {"trend": 2.0, "cause": 2.0, "change": 1.0, "outlier": 0.5, "fault": 0.3}
"""What goes on, and what has a name, before what is over, and that before bad data."""
_MOST = 2.0
"""Times the limit: what is farther off is no more urgent."""


def urgency(alarm: Alarm, settings: TrendSettings = DEFAULT) -> float:
    """Return how soon an alarm asks for a look: by its kind, and the share of its limit that it has used
    up or the share of the days that name it."""
    if alarm.kind in ("trend", "change") and math.isfinite(alarm.relative):
        return _BASE[alarm.kind] * min(abs(alarm.relative) / settings.limit, _MOST)
    return _BASE[alarm.kind] * alarm.share


def by_joint(alarms: Iterable[Alarm]) -> dict[str, list[Alarm]]:
    """Return the alarms of each joint, the most urgent first, of the joints in that order too."""
    groups: dict[str, list[Alarm]] = {}
    for alarm in alarms:
        groups.setdefault(alarm.joint, []).append(alarm)
    inner = {j: sorted(g, key=lambda a: -urgency(a)) for j, g in groups.items()}
    return dict(sorted(inner.items(), key=lambda item: (-urgency(item[1][0]), item[0])))


def worst_first(joints: Sequence[str], alarms: Iterable[Alarm]) -> list[str]:
    """Return all joints, those with alarms first."""
    alarmed = by_joint(alarms)
    return [*alarmed, *(j for j in joints if j not in alarmed)]
