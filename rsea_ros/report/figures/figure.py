"""A figure as plain values in the terms of plotly.js: a sentence that says the finding, traces, layout.

Few colours, each with one meaning on every page; colour-blind readers can distinguish them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rsea_ros.records.record import FloatArray

Json = dict[str, Any]
INK = "#1f2933"
QUIET = "#66717d"
GRID = "#e6e9ec"
MEASURED = "#7b8794"
AFTER = "#1864ab"
"""The model at the end: fitted, or extended."""
BEFORE = "#d9730d"
"""The model that something is wrong with."""
NOISE = "#adb5bd"
TRUTH = "#2b8a3e"

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
KEY: Json = {"thickness": 9, "outlinewidth": 0}
"""The bar that names colours."""


def faint(colour: str, opacity: float) -> str:
    """Return a #rrggbb colour as rgba() of an opacity from 0 to 1."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


@dataclass(frozen=True)
class Figure:
    """title: the finding in a sentence. caption: how to read it. kind: what page.js does beyond drawing."""

    title: str
    caption: str
    data: Sequence[Json]
    layout: Mapping[str, Any]
    height: int = 420
    kind: str = "plain"
    extra: Mapping[str, Any] = field(default_factory=dict)


class Curve(NamedTuple):
    """Values of shape (n,) with their name on the page and their colour."""

    name: str
    colour: str
    values: FloatArray


def numbers(values: FloatArray) -> list[float | None]:
    """Return values for JSON: eight significant digits, which resolve values close to each other; None where
    not finite."""
    return [float(f"{v:.8g}") if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def _places(values: FloatArray | list[Any]) -> list[Any]:
    return list(values) if isinstance(values, list) else numbers(values)


def layout(**parts: Any) -> Json:
    """Return a layout in the style of the page; `parts` go on top."""
    base: Json = {
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 64, "r": 96, "t": 12, "b": 48},
        "showlegend": False,
        "hovermode": "x unified",
        "hoverlabel": {"bgcolor": "#ffffff", "bordercolor": GRID, "font": {"family": FONT, "size": 12}},
        "dragmode": "zoom",
    }
    return {**base, **parts}


def axis(title: str = "", **parts: Any) -> Json:
    """Return an axis: thin grid, no box, its title with the unit."""
    base: Json = {
        "title": {"text": title, "font": {"size": 12, "color": QUIET}, "standoff": 8},
        "gridcolor": GRID,
        "zeroline": False,
        "linecolor": GRID,
        "ticks": "outside",
        "tickcolor": GRID,
        "ticklen": 4,
        "tickfont": {"size": 12, "color": QUIET},
        "automargin": True,
    }
    return {**base, **parts}


def marks(low: float, high: float, each: Sequence[int] = (1, 2, 5)) -> list[float]:
    """Return these numbers of each decade from low to high."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [m * 10.0**d for d in decades for m in each if 0.999 * low <= m * 10.0**d <= 1.001 * high]


def log_axis(title: str, low: float, high: float, each: Sequence[int] = (1, 2, 5), **parts: Any) -> Json:
    """Return a logarithmic axis from low to high; some numbers of each decade stand as plain numbers."""
    shown, ends = marks(low, high, each), [math.log10(low), math.log10(high)]
    text = [f"{m:g}" for m in shown]
    return axis(title, **{"type": "log", "range": ends, "tickvals": shown, "ticktext": text, **parts})


def frequency_axis(low: float, high: float, **parts: Any) -> Json:
    """Return a logarithmic axis from low to high, Hz."""
    hover: Json = {"hoverformat": ".3g", "unifiedhovertitle": {"text": "%{x} Hz"}}
    return log_axis("frequency, Hz", low, high, **hover, **parts)


def line(
    x: FloatArray | list[str], y: FloatArray, name: str, colour: str, width: float = 1.6, dash: str = "",
    **parts: Any,
) -> Json:  # fmt: skip
    """Return a line trace. x: numbers, or dates as text. dash: of plotly, solid by default.

    Raises ValueError without a hovertemplate (the value with its unit) and without a hoverinfo.
    """
    if not {"hovertemplate", "hoverinfo"} & parts.keys():
        raise ValueError(f"line {name!r} has no hovertemplate, expected one with the unit of its values")
    trace: Json = {
        "type": "scatter",
        "mode": "lines",
        "x": _places(x),
        "y": numbers(y),
        "name": name,
        "line": {"color": colour, "width": width, **({"dash": dash} if dash else {})},
    }
    return {**trace, **parts}


def band(x: FloatArray | list[str], low: FloatArray, high: FloatArray, colour: str, **parts: Any) -> Json:
    """Return a filled band from low to high, without hover. x: numbers, or dates as text."""
    places = _places(x)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": [*places, *places[::-1]],
        "y": numbers(np.concatenate([high, low[::-1]])),
        "fill": "toself",
        "fillcolor": colour,
        "line": {"width": 0},
        "hoverinfo": "skip",
        **parts,
    }


def label(text: str, x: float, y: float, colour: str, **parts: Any) -> Json:
    """Return a label in the colour of its curve, beside it, instead of a legend."""
    base: Json = {
        "text": text,
        "x": x,
        "y": y,
        "showarrow": False,
        "xanchor": "left",
        "yanchor": "middle",
        "align": "left",
        "font": {"size": 12, "color": colour},
    }
    return {**base, **parts}


def points(
    x: FloatArray | list[Any], y: FloatArray | list[Any], name: str, colour: str, size: float, **parts: Any
) -> Json:
    """Return a trace of points. x: numbers, or dates as text. size: px."""
    marker = {"size": size, "color": colour}
    return {"type": "scatter", "mode": "markers", "x": _places(x), "y": _places(y), "name": name,
            "marker": marker, **parts}  # fmt: skip


def named(traces: Sequence[Json]) -> list[tuple[str, str]]:
    """Return the name and the colour of each line."""
    return [(trace["name"], trace["line"]["color"]) for trace in traces]


def names_beside(items: Sequence[tuple[str, str]], step: float, x: float = 1.015) -> list[Json]:
    """Return the names of curves, each with its colour, one below the other right of the figure."""
    return [
        label(name, x, 1.0 - step * i, colour, xref="paper", yref="paper", yanchor="top")
        for i, (name, colour) in enumerate(items)
    ]
