"""Parts of figures over time: axes of dates, marks of changes."""

from __future__ import annotations

from typing import Any

from rsea_ros.records.record import FloatArray
from rsea_ros.report.figures.figure import Json, axis
from rsea_ros.report.figures.palette import BEFORE, faint
from rsea_ros.report.fleet.words import dates
from rsea_ros.trends.settings import DAY
from rsea_ros.trends.weeks import Steps

_DAY = "%-d %b\n%Y"
_FEW = 14
"""Days up to which each has its name: plotly would name their hours."""


def date_axis(steps: Steps, until_s: float = 0.0) -> Json:
    """Return an axis of dates over all steps, longer where something lies beyond them."""
    end = max(float(steps.edges[-1]), until_s)
    first, last = dates([steps.edges[0], end])  # type: ignore[arg-type]
    days = (end - float(steps.edges[0])) / DAY
    stride = 1 if days <= _FEW / 2 else 2
    ticks = {"dtick": 1000.0 * DAY * stride, "tickformat": _DAY} if days <= _FEW else {}
    formats = [{"dtickrange": [None, "M1"], "value": _DAY}, {"dtickrange": ["M1", None], "value": "%b\n%Y"}]
    return axis("", type="date", range=[first, last], showgrid=False, hoverformat="%e %b %Y",
                tickformatstops=[] if ticks else formats, **ticks)  # fmt: skip


def points(time_s: FloatArray, y: list[float | None], title: str, **parts: Any) -> Json:
    """Return a trace over dates."""
    return {"type": "scatter", "mode": "markers", "x": dates(time_s), "y": y, "name": title, **parts}


def change_marks(since_s: float, earliest_s: float, latest_s: float) -> list[Json]:
    """Return a line where something changed, and a band where it may have."""
    a, b, c = dates([earliest_s, since_s, latest_s])  # type: ignore[arg-type]
    common = {"xref": "x", "yref": "paper", "y0": 0.0, "y1": 1.0}
    band = {"type": "rect", "x0": a, "x1": c, "fillcolor": faint(BEFORE, 0.14), "line": {"width": 0}}
    stroke = {"type": "line", "x0": b, "x1": b, "line": {"color": BEFORE, "width": 1.2, "dash": "dot"}}
    return [{**common, **band, "layer": "below"}, {**common, **stroke}]
