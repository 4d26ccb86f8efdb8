"""A timeline: a bar for each finding from the day on which it began."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from rsea_ros.report.fleet.dates_below import months, share
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.words import about, doubt_of_date, short_day
from rsea_ros.report.page.html import section
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.weeks import Steps

_MOST = 24


def timeline(alarms: Sequence[Alarm], steps: Steps, links: Links) -> str:
    """Return the section of the findings that have a date, in the order given; empty without one."""
    dated = [a for a in alarms if math.isfinite(a.since_s)]
    shown = dated[:_MOST]
    if not shown:
        return ""
    first = min(shown, key=lambda a: a.since_s)
    number = "one finding" if len(dated) == 1 else f"{len(dated)} findings"
    more = f" The first {_MOST} of {len(dated)} findings." if len(dated) > _MOST else ""
    rows = "".join(_row(a, steps, links) for a in shown)
    return section(
        f"What changed since when: {number}, the earliest of {short_day(first.since_s)}",
        f'<div class="spans">{rows}{months(steps)}</div>',
        caption="A bar begins on the day of the change, pale if that day is uncertain, or with the first "
        "recording if that shows it. Orange: it continues, "
        f"or has a name. Blue: the change is over, its level stays. Grey: bad data.{more}",
    )


def _row(alarm: Alarm, steps: Steps, links: Links) -> str:
    begin, end = share(alarm.since_s, steps), 100.0
    early, late = share(alarm.earliest_s, steps), share(alarm.latest_s, steps)
    return (
        f'<div class="span {alarm.kind}"><p>{links.joint(alarm.joint)} {escape(about(alarm))}'
        f"<small>began {escape(doubt_of_date(alarm))}</small></p>"
        f'<div class="rail"><i class="doubt" style="left:{early:.1f}%;width:{late - early:.1f}%"></i>'
        f'<i style="left:{begin:.1f}%;width:{end - begin:.1f}%"></i></div></div>'
    )
