"""Horizontal bars with their values beside them: misfit, gains, what was tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.report.figures.figure import Figure, Json, axis, layout
from rsea_ros.report.figures.palette import AFTER, MEASURED, QUIET, faint


@dataclass(frozen=True)
class Bar:
    """A row: its name, value, text beside it, 95 % interval where there is one, and whether it stands out."""

    name: str
    value: float
    text: str
    interval: tuple[float, float] | None = None
    strong: bool = False


def bar_figure(
    title: str, bars: Sequence[Bar], axis_title: str, caption: str = "", colour: str = AFTER
) -> Figure:
    """Return the bars in the order given, first on top."""
    rows = bars[::-1]
    values = np.array([b.value for b in rows])
    low, high = (np.array([b.interval[side] if b.interval else b.value for b in rows]) for side in (0, 1))
    trace: Json = {
        "type": "bar",
        "orientation": "h",
        "y": [b.name for b in rows],
        "x": [float(v) for v in values],
        "marker": {"color": [colour if b.strong else faint(MEASURED, 0.5) for b in rows]},
        "width": 0.62,
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": [float(v) for v in high - values],
            "arrayminus": [float(v) for v in values - low],
            "color": QUIET,
            "thickness": 1.2,
            "width": 3,
            "visible": any(b.interval for b in rows),
        },
        "hoverinfo": "skip",
    }
    names: list[Json] = [
        {
            "x": float(max(h, 0.0)),
            "y": b.name,
            "text": b.text,
            "showarrow": False,
            "xanchor": "left",
            "xshift": 8,
            "font": {"size": 12, "color": colour if b.strong else QUIET},
        }
        for b, h in zip(rows, high, strict=True)
    ]
    return Figure(
        title=title,
        caption=caption,
        data=[trace],
        layout=layout(
            xaxis=axis(
                axis_title,
                showgrid=False,
                showticklabels=False,
                ticks="",
                rangemode="tozero",
                zeroline=True,
                zerolinecolor=faint(MEASURED, 0.6),
            ),
            yaxis=axis("", showgrid=False, ticks=""),
            annotations=names,
            hovermode=False,
            margin={"l": 40, "r": 150, "t": 8, "b": 44},
        ),
        height=72 + 34 * len(bars),
    )
