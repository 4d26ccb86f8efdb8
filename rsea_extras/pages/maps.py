"""Pictures of a fleet as wide as the page: joints × weeks, and a bar for each finding from its day on."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from rsea_extras.pages import words as say
from rsea_extras.pages.figures import date_axis
from rsea_extras.trends.result import Alarm, FleetTrends, Steps, Trend, bin_days
from rsea_extras.trends.series import BoolArray
from rsea_ros.extension.base import FloatArray
from rsea_ros.extension.page import fig

_QUANTILE, _NOISE, _LEAST = 0.995, 8.0, 0.01
"""Colours are full at this quantile of the changes, at so many times their median, and at 1 %, at least."""
_OFTEN = 0.5
"""Share of the recordings of a step that counts as often."""
_MOST = 24
"""Findings of the timeline."""
_ROW, _AROUND = 17, 72
"""Pixels of a joint's row, and of the axis and the margins."""
_SINCE = 34
"""Pixels of a finding: its words, and its bar below them."""
_PALE = fig.faint(fig.MEASURED, 0.1)
_HOVER = "%{{y}}, %{{x}}: {}<extra></extra>"
_TONES = {"change": fig.AFTER, "fault": fig.MEASURED}
"""Colours of the findings that neither go on nor have a name: those that do are orange."""


def heat_map(parameter: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps) -> fig.Figure:
    """Return the figure of a parameter, the first joint on top; grey if not determined."""
    rows = [fleet.trends.get((joint, parameter), fleet.sizes.get((joint, parameter))) for joint in joints]
    change, undetermined = map(np.array, zip(*(_row(trend, steps) for trend in rows), strict=True))
    sizes, full = np.abs(change[np.isfinite(change)]), 1.0
    if sizes.size:  # noise alone stays pale
        full = float(max(_LEAST, np.quantile(sizes, _QUANTILE), _NOISE * np.median(sizes)))
    determined = [t for t in rows if t is not None and t.state != "undetermined"]
    moved = [t for t in determined if t.state != "steady"]
    which = f"all {len(determined)} joints that determine it" if len(determined) > 1 else "one joint"
    title = f"{say.name(parameter)}: steady in {which}"
    if moved:
        most = max(moved, key=lambda t: abs(t.relative))
        where = f"{len(moved)} of {len(determined)} joints, most in {most.series.joint}"
        title = f"{say.name(parameter)}: changed in {where}, by {say.percent(most.relative)}"
    caption = (
        f"Mean of each {steps.name} against the joint's first level, at its mean temperature. Grey: "
        "recordings that do not determine it, or of too few days for a level. Empty: no recording."
    )
    shades, ends = [[0.0, fig.AFTER], [0.5, _PALE], [1.0, fig.BEFORE]], [-full, 0.0, full]
    key = {"tickvals": ends, "ticktext": [say.percent(-full), "first day", say.percent(full)], **fig.KEY}
    unknown = {"z": np.where(undetermined, 1.0, np.nan), "hovertemplate": _HOVER.format("not determined"),
               "colorscale": [[0.0, fig.NOISE], [1.0, fig.NOISE]], "showscale": False}  # fmt: skip
    cells = {"z": change, "zmin": -full, "zmax": full, "colorscale": shades, "colorbar": key}
    return _map(title, caption, joints, steps, [unknown, cells])


def naming_map(
    subject: str, kind: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps
) -> fig.Figure:
    """Return the figure of a cause or a fault: the share of each week's recordings that name it."""
    of = {n.joint: n for n in fleet.namings if (n.about, n.kind) == (subject, kind)}
    asked = np.array([steps.count(of[j].time_s) for j in joints])
    named = np.array([steps.count(of[j].time_s[of[j].named]) for j in joints])
    share: FloatArray = np.where(asked > 0, named / np.maximum(asked, 1), np.nan)
    often = int(np.sum(np.any(share >= _OFTEN, axis=1)))
    plain = say.name(subject) + ("" if kind == "cause" else " in the data")
    title = f"{plain}: often in {often} of {len(fleet.joints)} joints"
    caption = f"Share of the recordings of each {steps.name} that name it, for joints with at least one."
    key = {"tickvals": [0.0, 1.0], "ticktext": ["none", "all"], **fig.KEY}
    shades = [[0.0, _PALE], [1.0, fig.BEFORE]]
    cells = {"z": share, "zmin": 0.0, "zmax": 1.0, "colorscale": shades, "colorbar": key}
    return _map(title, caption, joints, steps, [cells])


def _map(
    title: str, caption: str, joints: Sequence[str], steps: Steps, layers: Sequence[dict[str, Any]]
) -> fig.Figure:
    """Return a map with a row for each joint. layers: traces; z of shape (joints, steps), NaN for none."""
    names = [escape(joint) for joint in joints]
    place: fig.Json = {"type": "heatmap", "x": say.dates(*steps.middle), "y": names, "xgap": 1, "ygap": 2,
                       "hovertemplate": _HOVER.format("%{z:.1%}")}  # fmt: skip
    data = [{**place, **layer, "z": [fig.numbers(row) for row in layer["z"]]} for layer in layers]
    rows = fig.axis(type="category", autorange="reversed", ticks="", showgrid=False, dtick=1)
    margin = {"l": 24, "r": 24, "t": 12, "b": 48}
    drawing = fig.layout(xaxis=date_axis(steps), yaxis=rows, hovermode="closest", margin=margin)
    return fig.Figure(title, caption, data, drawing, _AROUND + _ROW * max(3, len(joints)))


def _row(trend: Trend | None, steps: Steps) -> tuple[FloatArray, BoolArray]:
    """Return the relative change of each week, and which weeks were recorded and not determined."""
    if trend is None:
        return np.full(len(steps), np.nan), np.zeros(len(steps), bool)
    bins, level = bin_days(trend, steps), trend.first.value if trend.first else math.nan
    change: FloatArray = (bins.value - level) / (abs(level) or math.nan)
    return change, (bins.recorded > 0) & ~np.isfinite(change)


def timeline(alarms: Sequence[Alarm], steps: Steps) -> list[fig.Figure]:
    """Return the figure of the findings that have a date, in the order given; none without one."""
    dated = [a for a in alarms if math.isfinite(a.since_s)]
    shown, data, names = dated[:_MOST], [], []
    first, last = float(steps.edges[0]), float(steps.edges[-1])
    for k, a in enumerate(shown):
        tone, began = _TONES.get(a.kind, fig.BEFORE), f"began {say.doubt_of_date(a)}<extra></extra>"
        for ends, colour in (((a.earliest_s, a.latest_s), fig.faint(tone, 0.35)), ((a.since_s, last), tone)):
            x = say.dates(*np.clip(ends, first, last))
            data.append(fig.line(x, np.full(2, k), "", colour, 9, hovertemplate=began))
        about = f"<b>{escape(a.joint)}</b> {escape(say.about(a))}"
        names.append(fig.label(about, 0.0, k, fig.INK, xref="paper", yanchor="bottom", yshift=5))
    drawing = fig.layout(
        xaxis=date_axis(steps), yaxis=fig.axis(visible=False, range=[len(shown) - 0.6, -0.9]),
        annotations=names, hovermode="closest", margin={"l": 24, "r": 24, "t": 0, "b": 48},
    )  # fmt: skip
    number = "one finding" if len(dated) == 1 else f"{len(dated)} findings"
    more = f" The first {_MOST} of {len(dated)} findings." if len(dated) > _MOST else ""
    caption = (
        "A bar begins on the day of the change, pale if that day is uncertain, or with the first "
        "recording if that shows it. Orange: it continues, or has a name. Blue: the change is over, its "
        f"level stays. Grey: bad data.{more}"
    )
    earliest = say.day(min((a.since_s for a in shown), default=0.0), short=True)
    title = f"What changed since when: {number}, the earliest of {earliest}"
    return [fig.Figure(title, caption, data, drawing, 60 + _SINCE * len(shown))] if shown else []
