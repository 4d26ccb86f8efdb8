"""Fig. 9: bandwidth over stiffness and inertia, Eq. (7), as a surface to turn and as its two views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.model.bandwidth import undamped_band
from rsea_ros.records.record import FloatArray
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout, line, numbers, points
from rsea_ros.report.figures.palette import INK, QUIET, faint

_SHADES = [[0.0, "#eef3f8"], [0.5, "#7fa8cf"], [1.0, "#123f6d"]]


@dataclass(frozen=True)
class Point:
    """An actuator. stiffness: K_s, N m/rad. inertia: between its ends, kg m^2, of either sign. pole: of its
    name, Hz. side: of the name at its pole. A negative inertia stands at its magnitude, above the surface."""

    name: str
    stiffness: float
    inertia: float
    colour: str
    pole: float = 60.0
    side: str = "top center"


def bandwidth_surface(title: str, shown: Sequence[Point], caption: str = "") -> Figure:
    """Return the surface of Eq. (7) with actuators on it; drag turns it."""
    k, j = _grid(shown)
    surface: Json = {
        "type": "surface",
        "x": numbers(k),
        "y": numbers(1e3 * j),
        "z": [numbers(row) for row in undamped_band(k[None, :], j[:, None])],
        "colorscale": _SHADES,
        "showscale": False,
        "opacity": 0.92,
        "contours": {"z": {"show": True, "start": 10, "end": 400, "size": 20, "color": faint(INK, 0.35)}},
        "hovertemplate": "K_s %{x:.0f} N·m/rad<br>inertia %{y:.2f} g·m²<br>%{z:.1f} Hz<extra></extra>",
    }
    return Figure(title, caption, [surface, *(_flag(p) for p in shown)], _scene(), 560)


def _flag(p: Point) -> Json:
    """Return a point of the surface with its name on a pole: text in the surface would be cut by it."""
    z = float(undamped_band(p.stiffness, p.inertia))
    return {
        "type": "scatter3d",
        "mode": "lines+markers+text",
        "x": [p.stiffness] * 2,
        "y": [1e3 * abs(p.inertia)] * 2,
        "z": [z, z + p.pole],
        "text": ["", f"<b>{p.name.replace(', n', ',<br>n')}</b>"],
        "textposition": p.side,
        "textfont": {"size": 12, "color": p.colour},
        "line": {"color": p.colour, "width": 3},
        "marker": {"size": [6, 0.1], "color": p.colour},
        "hovertemplate": f"{p.name}: {z:.1f} Hz<extra></extra>",
    }


def _scene() -> Json:
    small = {"size": 11, "color": QUIET}
    plain = {"gridcolor": "#dfe4e8", "backgroundcolor": "rgba(0,0,0,0)", "tickfont": small}

    def axis(text: str, **parts: object) -> Json:
        return {**plain, "title": {"text": text, "font": {"size": 12, "color": QUIET}}, **parts}

    return layout(
        scene={
            "xaxis": axis("stiffness, N·m/rad", type="log", **log_marks(200, 500, 1000, 2000)),
            "yaxis": axis("inertia, g·m²", type="log", **log_marks(0.5, 1, 2, 5, 10)),
            "zaxis": axis("bandwidth, Hz"),
            "camera": {"eye": {"x": -1.36, "y": -1.42, "z": 0.68}, "center": {"x": 0, "y": 0, "z": -0.2}},
            "aspectratio": {"x": 1.25, "y": 1.25, "z": 0.85},
        },
        hovermode="closest",
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
    )


def slices(title: str, shown: Sequence[Point], caption: str = "") -> Figure:
    """Return Fig. 9 (b) and (c): bandwidth over inertia at some stiffnesses, and the other way round."""
    k, j = _grid(shown)
    shades = ("#9db9d6", "#5f8fbf", "#1864ab")
    views = [(f"{v:.0f} N·m/rad", 1e3 * j, undamped_band(v, j), "") for v in (200.0, 600.0, 1800.0)]
    views += [(f"{1e3 * v:g} g·m²", k, undamped_band(k, v), "2") for v in (1e-2, 3e-3, 1e-3)]
    data, names = [], []
    for (name, x, y, which), shade in zip(views, shades * 2, strict=True):
        place: Json = {"xaxis": f"x{which}", "yaxis": f"y{which}"} if which else {}
        data.append(line(x, y, name, shade, hovertemplate="%{y:.1f} Hz", **place))
        at: Json = {"xref": f"x{which}", "yref": f"y{which}", "xshift": 6}
        names.append(label(name, float(np.log10(x[-1])), float(np.log10(y[-1])), shade, **at))
    for p in shown:
        z, dot = [float(undamped_band(p.stiffness, p.inertia))], {"size": 9, "color": p.colour}
        data.append(points([1e3 * abs(p.inertia)], z, p.name, marker=dot))
        data.append(points([p.stiffness], z, p.name, marker=dot, xaxis="x2", yaxis="y2"))
    decades = {"type": "log"} | log_marks(0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
    drawing = layout(
        xaxis=axis("inertia, g·m²", domain=[0.0, 0.4], anchor="y", **decades),
        yaxis=axis("bandwidth, Hz", anchor="x", **decades),
        xaxis2=axis("stiffness, N·m/rad", domain=[0.56, 0.97], anchor="y2", **decades),
        yaxis2=axis("", anchor="x2", **decades),
        annotations=names,
        hovermode="closest",
    )
    return Figure(title, caption, data, drawing, 400)


def log_marks(*values: float) -> Json:
    """Return plain numbers on a logarithmic axis."""
    return {"tickvals": list(values), "ticktext": [f"{v:g}" for v in values]}


def _grid(shown: Sequence[Point]) -> tuple[FloatArray, FloatArray]:
    """Return stiffnesses and inertias that hold the points with room around."""
    k, j = (np.abs([getattr(p, n) for p in shown]) for n in ("stiffness", "inertia"))
    stiffness: FloatArray = np.geomspace(min(100.0, k.min() / 2), max(4000.0, 1.5 * k.max()), 40)
    inertia: FloatArray = np.geomspace(min(3e-4, j.min() / 2), max(2e-2, 1.5 * j.max()), 40)
    return stiffness, inertia
