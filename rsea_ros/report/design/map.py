"""The map of feasible designs: stiffness over chassis inertia, with a line for every demand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.report.design.surface import Point, log_marks
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, line
from rsea_ros.report.figures.palette import TRUTH, faint

_TOP = 2e4


@dataclass(frozen=True)
class LeastStiffness:
    """The least K_s (N m/rad) for a demand, at each inertia of the chassis (kg m^2)."""

    name: str
    colour: str
    inertia: FloatArray
    stiffness: FloatArray


def feasible_map(
    title: str, points: Sequence[Point], demands: Sequence[LeastStiffness], caption: str = ""
) -> Figure:
    """Return the plane of inertia and stiffness: above every line a design meets that demand."""
    inertia = demands[0].inertia
    least = np.max([d.stiffness for d in demands], axis=0)
    hidden: Json = {"hoverinfo": "skip", "line": {"width": 0}}
    data: list[Json] = [
        line(1e3 * inertia, np.full(len(inertia), _TOP), "", TRUTH, **hidden),
        line(1e3 * inertia, least, "", TRUTH, fill="tonexty", fillcolor=faint(TRUTH, 0.12), **hidden),
    ]
    names = [_label("<b>meets all demands</b>", inertia[len(inertia) // 3], 0.6 * _TOP, TRUTH)]
    for demand in demands:
        hover: Json = {"hovertemplate": "%{y:.0f} N·m/rad"}
        data.append(line(1e3 * demand.inertia, demand.stiffness, demand.name, demand.colour, **hover))
        names.append(
            label(demand.name, 1.01, float(np.log10(demand.stiffness[-1])), demand.colour, xref="paper")
        )
    for p in points:
        data.append(_dot(p))
        names.append(_label(f"<b>{p.name}</b>", p.inertia, p.stiffness, p.colour, xshift=8, yshift=-11))
    return Figure(title, caption, data, _layout(names), 460)


def _dot(p: Point) -> Json:
    return {
        "type": "scatter",
        "mode": "markers",
        "x": [1e3 * p.inertia],
        "y": [p.stiffness],
        "name": p.name,
        "marker": {"size": 10, "color": p.colour},
        "hovertemplate": "%{y:.0f} N·m/rad",
    }


def _label(text: str, inertia: float, stiffness: float, colour: str, **parts: float) -> Json:
    return label(text, float(np.log10(1e3 * inertia)), float(np.log10(stiffness)), colour, **parts)


def _layout(names: list[Json]) -> Json:
    height = [float(np.log10(50.0)), float(np.log10(_TOP))]
    return layout(
        xaxis=axis("spring chassis inertia J_sc, g·m²", type="log", **log_marks(0.2, 0.5, 1, 2, 5, 10, 20)),
        yaxis=axis(
            "stiffness K_s, N·m/rad",
            type="log",
            range=height,
            **log_marks(100, 200, 500, 1000, 2000, 5000, 10000),
        ),
        annotations=names,
        hovermode="closest",
        margin={"l": 72, "r": 210, "t": 12, "b": 48},
    )
