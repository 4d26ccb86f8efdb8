"""A cause of a joint over time: its size where it is named, the detection limit where it is not."""

from __future__ import annotations

import numpy as np

from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, numbers
from rsea_ros.report.figures.palette import BEFORE, MEASURED, NOISE, QUIET, faint
from rsea_ros.report.fleet.marks import change_marks, date_axis, points
from rsea_ros.report.fleet.words import beginning, cause_name, name, size_now
from rsea_ros.trends.cause_series import Naming
from rsea_ros.trends.result import Appearance
from rsea_ros.trends.weeks import Steps

_BAR = 0.9 * 86_400_000.0
"""Width of a bar, ms for each day of its step: plotly draws a single bar without one as a hairline."""


def cause_figure(naming: Naming, appearance: Appearance | None, steps: Steps) -> Figure:
    """Return the figure of a cause that has a size."""
    assert naming.size is not None
    typical = float(np.nanmedian(np.abs(naming.size))) if np.any(np.isfinite(naming.size)) else 1.0
    factor, unit = (100.0, "%") if naming.unit == "1" else words.unit_factor(typical, naming.unit)
    limit = naming.limit * factor
    shapes = _since(appearance) + _limit_band(limit)
    note = (
        [label("detection limit", 0.0, limit, QUIET, xref="paper", yanchor="bottom")]
        if np.isfinite(limit)
        else []
    )
    return Figure(
        title=_title(naming, appearance),
        caption=f"Median size of each {steps.name}, with the middle half. Grey at zero: recordings that do "
        "not name it; below the detection limit they could not.",
        data=[_sizes(naming, steps, factor, unit), _zeros(naming, steps)],
        layout=layout(
            xaxis=date_axis(steps),
            yaxis=axis(f"{naming.parameter.replace('_', ' ')}, {unit}".rstrip(", "), rangemode="tozero"),
            shapes=shapes,
            annotations=note,
            margin={"l": 64, "r": 24, "t": 12, "b": 40},
        ),
        height=260,
    )


def share_figure(naming: Naming, appearance: Appearance | None, steps: Steps) -> Figure:
    """Return the figure of a fault, or of a cause without a size: the share of recordings that name it."""
    asked, named = steps.count(naming.time_s), steps.count(naming.time_s[naming.named])
    some = asked > 0
    bars = {
        "type": "bar",
        "name": "recordings",
        "width": _BAR * steps.days,
        **{k: v for k, v in points(steps.middle[some], numbers(100.0 * named[some] / asked[some]), "").items()
           if k in ("x", "y")},
        "marker": {"color": faint(BEFORE if naming.kind == "cause" else MEASURED, 0.8)},
        "customdata": [[int(a), int(b)] for a, b in zip(named[some], asked[some], strict=True)],
        "hovertemplate": "%{customdata[0]} of %{customdata[1]} recordings<extra></extra>",
    }  # fmt: skip
    return Figure(
        title=_title(naming, appearance),
        caption=f"Share of the recordings of each {steps.name} that name it.",
        data=[bars],
        layout=layout(
            xaxis=date_axis(steps),
            yaxis=axis("%", range=[0.0, 102.0]),
            shapes=_since(appearance),
            margin={"l": 64, "r": 24, "t": 12, "b": 40},
        ),
        height=200,
    )


def _title(naming: Naming, appearance: Appearance | None) -> str:
    plain = name(naming.about) + (" in the data" if naming.kind == "fault" else "")
    often = f"{int(np.sum(naming.named))} of {len(naming.named)} recordings"
    if appearance is None:
        return f"{plain}{' is named' if naming.kind == 'cause' else ''} in {often}"
    plain = plain if naming.kind == "fault" else cause_name(appearance)
    return f"{plain} {beginning(appearance)}{size_now(appearance)}"


def _since(appearance: Appearance | None) -> list[Json]:
    if appearance is None or appearance.from_first:
        return []
    return change_marks(appearance.since_s, appearance.earliest_s, appearance.latest_s)


def _limit_band(limit: float) -> list[Json]:
    if not np.isfinite(limit):
        return []
    return [{"type": "rect", "xref": "paper", "x0": 0.0, "x1": 1.0, "y0": 0.0, "y1": limit, "layer": "below",
             "fillcolor": faint(NOISE, 0.18), "line": {"width": 0}}]  # fmt: skip


def _sizes(naming: Naming, steps: Steps, factor: float, unit: str) -> Json:
    assert naming.size is not None
    usable = naming.named & np.isfinite(naming.size)
    place, size = steps.place(naming.time_s[usable]), naming.size[usable] * factor
    weeks = np.unique(place)
    middle = np.array([np.quantile(size[place == k], (0.25, 0.5, 0.75)) for k in weeks]).reshape(-1, 3)
    return points(
        steps.middle[weeks],
        numbers(middle[:, 1]),
        "named",
        marker={"color": BEFORE, "size": 6},
        error_y={
            "type": "data", "symmetric": False, "array": numbers(middle[:, 2] - middle[:, 1]),
            "arrayminus": numbers(middle[:, 1] - middle[:, 0]), "color": faint(BEFORE, 0.6), "width": 0,
            "thickness": 1.2,
        },
        hovertemplate=f"%{{y:.4g}} {unit}",
    )  # fmt: skip


def _zeros(naming: Naming, steps: Steps) -> Json:
    without = steps.count(naming.time_s[~naming.named]) > 0
    weeks = steps.middle[without]
    return points(
        weeks, [0.0] * len(weeks), "not named", marker={"color": NOISE, "size": 4}, hovertemplate="not named"
    )
