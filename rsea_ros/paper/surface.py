"""Fig. 9: bandwidth over stiffness and inertia, Eq. (7), as contours and as the surface's two views."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.model.transfer import undamped_band
from rsea_ros.records.record import FloatArray
from rsea_ros.report.figures import figure as fig

_SHADES = [[0.0, "#eef3f8"], [0.5, "#7fa8cf"], [1.0, "#123f6d"]]


@dataclass(frozen=True)
class Point:
    """An actuator. stiffness: K_s, N m/rad. inertia: between its ends, kg m^2, of either sign; a negative one
    stands at its magnitude. side: where its name stands."""

    name: str
    stiffness: float
    inertia: float
    colour: str
    side: str = "top center"


def bandwidth_contours(title: str, shown: Sequence[Point], caption: str = "") -> fig.Figure:
    """Return lines of equal bandwidth by Eq. (7) with actuators among them."""
    k, j = _grid(shown)
    contours: fig.Json = {
        "type": "contour",
        "x": fig.numbers(k),
        "y": fig.numbers(1e3 * j),
        "z": [fig.numbers(row) for row in undamped_band(k[None, :], j[:, None])],
        "colorscale": _SHADES,
        "showscale": False,
        "contours": {"start": 20, "end": 400, "size": 20, "showlabels": True},
        "line": {"color": fig.faint(fig.INK, 0.35)},
        "hovertemplate": "K_s %{x:.0f} N·m/rad<br>inertia %{y:.2f} g·m²<br>%{z:.1f} Hz<extra></extra>",
    }
    plane = fig.layout(
        xaxis=fig.log_axis("stiffness, N·m/rad", k[0], k[-1]),
        yaxis=fig.log_axis("inertia, g·m²", 1e3 * j[0], 1e3 * j[-1]),
        hovermode="closest",
    )
    return fig.Figure(title, caption, [contours, *(_named(p) for p in shown)], plane, 480)


def _named(p: Point) -> fig.Json:
    z = float(undamped_band(p.stiffness, p.inertia))
    return {
        "type": "scatter",
        "mode": "markers+text",
        "x": [p.stiffness],
        "y": [1e3 * abs(p.inertia)],
        "text": [f"<b>{p.name.replace(', n', ',<br>n')}</b>"],
        "textposition": p.side,
        "textfont": {"size": 12, "color": fig.INK},
        "marker": {"size": 9, "color": p.colour, "line": {"color": "#ffffff", "width": 1}},
        "hovertemplate": f"{p.name}: {z:.1f} Hz<extra></extra>",
    }


def slices(title: str, shown: Sequence[Point], caption: str = "") -> fig.Figure:
    """Return Fig. 9 (b) and (c): bandwidth over inertia at some stiffnesses, and the other way round."""
    k, j = _grid(shown)
    shades = ("#9db9d6", "#5f8fbf", "#1864ab")
    views = [(f"{v:.0f} N·m/rad", 1e3 * j, undamped_band(v, j), "") for v in (200.0, 600.0, 1800.0)]
    views += [(f"{1e3 * v:g} g·m²", k, undamped_band(k, v), "2") for v in (1e-2, 3e-3, 1e-3)]
    data, names = [], []
    for (name, x, y, which), shade in zip(views, shades * 2, strict=True):
        place: fig.Json = {"xaxis": f"x{which}", "yaxis": f"y{which}"} if which else {}
        data.append(fig.line(x, y, name, shade, hovertemplate="%{y:.1f} Hz", **place))
        at: fig.Json = {"xref": f"x{which}", "yref": f"y{which}", "xshift": 6}
        names.append(fig.label(name, float(np.log10(x[-1])), float(np.log10(y[-1])), shade, **at))
    for p in shown:
        z = [float(undamped_band(p.stiffness, p.inertia))]
        data.append(fig.points([1e3 * abs(p.inertia)], z, p.name, p.colour, 9))
        data.append(fig.points([p.stiffness], z, p.name, p.colour, 9, xaxis="x2", yaxis="y2"))
    ticks = fig.marks(0.5, 2000.0)
    decades = {"type": "log", "tickvals": ticks, "ticktext": [f"{v:g}" for v in ticks]}
    drawing = fig.layout(
        xaxis=fig.axis("inertia, g·m²", domain=[0.0, 0.4], anchor="y", **decades),
        yaxis=fig.axis("bandwidth, Hz", anchor="x", **decades),
        xaxis2=fig.axis("stiffness, N·m/rad", domain=[0.56, 0.97], anchor="y2", **decades),
        yaxis2=fig.axis("", anchor="x2", **decades),
        annotations=names,
        hovermode="closest",
    )
    return fig.Figure(title, caption, data, drawing, 400)


def _grid(shown: Sequence[Point]) -> tuple[FloatArray, FloatArray]:
    """Return stiffnesses and inertias that hold the points with room around."""
    k, j = (np.abs([getattr(p, n) for p in shown]) for n in ("stiffness", "inertia"))
    stiffness: FloatArray = np.geomspace(min(100.0, k.min() / 2), max(4000.0, 1.5 * k.max()), 40)
    inertia: FloatArray = np.geomspace(min(3e-4, j.min() / 2), max(2e-2, 1.5 * j.max()), 40)
    return stiffness, inertia
