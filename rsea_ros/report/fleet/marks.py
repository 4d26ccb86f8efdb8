"""Parts of figures over time: axes of dates, marks of changes."""

from __future__ import annotations

from typing import Any

from rsea_ros.report.figures.figure import Json, axis
from rsea_ros.report.figures.palette import BEFORE, faint
from rsea_ros.report.fleet.words import dates
from rsea_ros.signals import FloatArray
from rsea_ros.trends.weeks import Steps


def date_axis(steps: Steps, until_s: float = 0.0) -> Json:
    """Return an axis of dates over all steps, longer where something lies beyond them."""
    first, last = dates([steps.edges[0], max(steps.edges[-1], until_s)])  # type: ignore[arg-type]
    return axis("", type="date", range=[first, last], showgrid=False, hoverformat="%e %b %Y")


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
