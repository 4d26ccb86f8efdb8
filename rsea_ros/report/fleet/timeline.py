"""What changed since when: a row for each finding, from the day on which it began."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.report.figure import Figure, Json, axis, label, layout
from rsea_ros.report.fleet.fleet_words import about, dates, doubt_of_date, short_day
from rsea_ros.report.fleet.marks import date_axis
from rsea_ros.report.palette import AFTER, BEFORE, INK, MEASURED, faint
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.weeks import Steps

_ROW = 40
_MOST = 24
_COLOUR = {"trend": BEFORE, "cause": BEFORE, "change": AFTER, "fault": MEASURED}


def timeline(alarms: Sequence[Alarm], steps: Steps) -> Figure | None:
    """Return the figure of the findings that have a date, in the order given; None without one."""
    dated = [a for a in alarms if math.isfinite(a.since_s)]
    shown = dated[:_MOST]
    if not shown:
        return None
    more = f" The first {_MOST} of {len(dated)} findings." if len(dated) > _MOST else ""
    return Figure(
        title=f"What changed since when: {_earliest(shown)}",
        caption="A bar begins on the day of the change, pale where that day is in doubt, and ends with the "
        "recordings. Orange: it goes on, or it has a name. Blue: a step that is over. Grey: bad data." + more,
        data=[t for i, a in enumerate(shown) for t in _bar(a, i, float(steps.edges[-1]))],
        layout=layout(
            xaxis=date_axis(steps),
            yaxis=axis("", visible=False, range=[len(shown) - 0.2, -0.8], fixedrange=True),
            annotations=[_text(a, i, steps) for i, a in enumerate(shown)],
            hovermode="closest",
            margin={"l": 12, "r": 12, "t": 8, "b": 36},
        ),
        height=70 + _ROW * len(shown),
    )


def _bar(alarm: Alarm, row: int, end: float) -> list[Json]:
    colour = _COLOUR.get(alarm.kind, MEASURED)
    hover = f"{alarm.joint}: {about(alarm)}<br>began {doubt_of_date(alarm)}<extra></extra>"
    common = {"type": "scatter", "mode": "lines", "hovertemplate": hover, "y": [row, row]}
    doubt = dates([alarm.earliest_s, alarm.latest_s])  # type: ignore[arg-type]
    certain = dates([alarm.since_s, end])  # type: ignore[arg-type]
    return [
        {**common, "x": doubt, "line": {"color": faint(colour, 0.35), "width": 11}},
        {**common, "x": certain, "line": {"color": colour, "width": 5 if alarm.kind != "change" else 2}},
        {**common, "mode": "markers", "x": certain[:1], "y": [row], "marker": {"color": colour, "size": 9}},
    ]


def _text(alarm: Alarm, row: int, steps: Steps) -> Json:
    """Return the label above a bar: from its beginning on, or up to it in the later half."""
    text = f"<b>{_escaped(alarm.joint)}</b>  {_escaped(about(alarm))}"
    first = dates([steps.edges[0]])[0]  # type: ignore[arg-type]
    return label(text, first, row, INK, yshift=13, font={"size": 12, "color": INK})  # type: ignore[arg-type]


def _earliest(alarms: Sequence[Alarm]) -> str:
    first = min(alarms, key=lambda a: a.since_s)
    return f"{len(alarms)} findings, the earliest of {short_day(first.since_s)}"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")
