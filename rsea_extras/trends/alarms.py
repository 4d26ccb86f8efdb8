"""Alarms, and the ranking of joints."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

import numpy as np

from rsea_extras.trends.fleet_trends import fleet_trends
from rsea_extras.trends.result import Alarm, FleetTrends, Interval, Trend
from rsea_extras.trends.series import DEFAULT, Table, TrendSettings


def alarms(history: Table, recordings: Table, settings: TrendSettings = DEFAULT) -> tuple[Alarm, ...]:
    """Return the alarms of a fleet, joint by joint, the surest first.

    history, recordings: as of fleet_trends. Raises ParameterError for a table without its columns.
    """
    return alarms_of(fleet_trends(history, recordings, settings))


def alarms_of(fleet: FleetTrends) -> tuple[Alarm, ...]:
    """Return the alarms of a fleet's trends.

    A cause that appeared is one alarm, its size included; a size that changes later is another where the
    joint had the cause from its first recording on.
    """
    appeared = {(a.joint, a.about) for a in fleet.appearances if a.kind == "cause" and not a.from_first}
    made = list(fleet.appearances)
    for trend in fleet.trends.values():
        made += _of_trend(trend)
    for (joint, name), trend in fleet.sizes.items():
        if (joint, name.split(".")[0]) not in appeared:
            made += _of_trend(trend)
    changed = {(a.joint, a.about) for a in made}
    made += [o for o in fleet.outliers if (o.joint, o.about) not in changed]
    return tuple(sorted(made, key=lambda a: (a.joint, -a.confidence, a.key)))


def _of_trend(trend: Trend) -> Iterator[Alarm]:
    """Yield one alarm for each run of changes of one direction; the last is a trend where it goes on.

    In runs, as wear that is seen as steps first is a ramp later.
    """
    s = trend.series
    every = [list(run) for _, run in groupby(trend.changes, lambda change: change.size.value > 0.0)]
    level = trend.first.value if trend.first is not None else float("nan")
    for number, run in enumerate(every, 1):
        sizes = [c.size for c in run]
        value = sum(s.value for s in sizes)
        half = 0.5 * float(np.sqrt(sum((s.high - s.low) ** 2 for s in sizes)))
        total = Interval(value, value - half, value + half)
        way = "higher" if total.value > 0.0 else "lower"
        goes_on = trend.state == "trending" and number == len(every) and run[-1].kind == "ramp"
        row = run[0].row
        yield Alarm(
            f"{s.joint}/{s.parameter}/{way}/{number}", s.joint, s.parameter, "trend" if goes_on else "change",
            run[0].since_s, run[0].earliest_s, run[0].latest_s, total, s.unit,
            total.value / abs(level) if level else float("nan"), 1.0 - trend.q,
            str(s.recording[row]), str(s.artefacts[row]), from_first=run[0].open_start,
        )  # fmt: skip
        level += total.value


_BASE = {"trend": 2.0, "cause": 2.0, "change": 1.0, "outlier": 0.5, "fault": 0.3}
"""What goes on, and what has a name, before what is over, and that before bad data."""
_MOST = 2.0
"""Times the limit: what is farther off is no more urgent."""


def urgency(alarm: Alarm) -> float:
    """Return how soon an alarm asks for a look: by its kind, and the share of its limit that it has used
    up or the share of the days that name it."""
    if alarm.kind in ("trend", "change") and math.isfinite(alarm.relative):
        return _BASE[alarm.kind] * min(abs(alarm.relative) / DEFAULT.limit, _MOST)
    return _BASE[alarm.kind] * alarm.share


def by_joint(alarms: Iterable[Alarm]) -> dict[str, list[Alarm]]:
    """Return the alarms of each joint, the most urgent first, of the joints in that order too."""
    groups: dict[str, list[Alarm]] = {}
    for alarm in alarms:
        groups.setdefault(alarm.joint, []).append(alarm)
    inner = {j: sorted(g, key=lambda a: -urgency(a)) for j, g in groups.items()}
    return dict(sorted(inner.items(), key=lambda item: (-urgency(item[1][0]), item[0])))


def worst_first(joints: Sequence[str], alarms: Iterable[Alarm]) -> list[str]:
    alarmed = by_joint(alarms)
    return [*alarmed, *(j for j in joints if j not in alarmed)]
