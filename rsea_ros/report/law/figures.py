"""Figures of a law: the missing torque and the law over its variable, and both over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.laws.law import WrittenLaw
from rsea_ros.records.record import FloatArray, IntArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, Json, axis, band, label, layout, line, numbers
from rsea_ros.report.figures.palette import AFTER, BEFORE, INK, MEASURED, QUIET, faint
from rsea_ros.report.law.words import NAMES, UNITS

_WINDOWS = 12
_CURVE = 160


def over_figure(written: WrittenLaw) -> Figure:
    """Return the missing torque and the law over the law's variable."""
    shown, law = written.shown, written.law
    x, y, unit = _fold_angle(written), shown.values, "rad" if law.place == "encoder" else "N m"
    centre, low, high = _curve(x, shown.law)
    middle, error = _bin_means(x, y, centre)
    windows = np.array_split(np.argsort(shown.t), _WINDOWS)
    data: list[Json] = [
        _points(x, y, faint(MEASURED, 0.28), 3.5, "measured"),
        *(_points(x[k], y[k], faint(BEFORE, 0.85), 5, "", visible=i == 0)
          for i, k in enumerate(windows)),
        band(centre, low, high, faint(AFTER, 0.16)),
        _bars(centre, middle, error),
        line(centre, 0.5 * (low + high), "law", AFTER, 2.6, hovertemplate=f"%{{y:.3g}} {words.unit(unit)}"),
    ]  # fmt: skip
    top = float(np.quantile(np.abs(y), 0.995))
    quantity = "angle" if unit == "rad" else "torque"
    wave = "one period of the " if _cycles(written) else ""
    return Figure(
        f"The missing {quantity} over the {NAMES[shown.over]}, and the law in it",
        f"Grey: missing in the simulation, point by point (one sigma {shown.sd:.2g} {words.unit(unit)}). "
        "Black: its mean with 95 %. Blue: the law; its band is the spread from its other variables. The "
        "slider shows one stretch of time in orange.",
        data,
        layout(
            xaxis=axis(f"{wave}{NAMES[shown.over]}, {words.unit(UNITS[shown.over])}"),
            yaxis=axis(f"missing, {words.unit(unit)}", range=[-1.15 * top, 1.15 * top]),
            hovermode="closest", sliders=[_slider(shown.t, windows)],
            margin={"l": 64, "r": 24, "t": 12, "b": 96},
        ),
        560,
    )  # fmt: skip


def _slider(t: FloatArray, windows: Sequence[IntArray]) -> Json:
    """Return the slider that shows one window of the record at a time. windows: indices into t (s)."""
    steps = [
        {"label": f"{t[k[0]]:.0f}", "method": "restyle",
         "args": ["visible", [True, *(j == i for j in range(len(windows))), True, True, True]]}
        for i, k in enumerate(windows)
    ]  # fmt: skip
    small = {"size": 12, "color": QUIET}
    value = {"prefix": "orange: from ", "suffix": " s on", "font": small}
    return {"active": 0, "currentvalue": value, "steps": steps, "pad": {"t": 44}, "len": 1.0, "x": 0.0,
            "tickcolor": QUIET, "font": small}  # fmt: skip


def _points(
    x: FloatArray, y: FloatArray, colour: str, size: float, name: str, *, visible: bool = True
) -> Json:
    return {"type": "scatter", "mode": "markers", "x": numbers(x), "y": numbers(y), "name": name,
            "marker": {"size": size, "color": colour}, "visible": visible, "hoverinfo": "skip"}  # fmt: skip


def _bars(x: FloatArray, y: FloatArray, error: FloatArray) -> Json:
    keep = np.isfinite(y)
    return {"type": "scatter", "mode": "markers", "x": numbers(x[keep][::6]), "y": numbers(y[keep][::6]),
            "error_y": {"type": "data", "array": numbers(error[keep][::6]), "thickness": 1.2, "width": 0,
                        "color": INK},
            "marker": {"size": 6, "color": INK}, "name": "mean"}  # fmt: skip


def _cycles(written: WrittenLaw) -> float:
    cycles = [p.shape for p in written.law.parts if p.term.shape == "cycles_per_revolution"]
    return cycles[0] if cycles and written.shown.over == "theta" else 0.0


def _fold_angle(written: WrittenLaw) -> FloatArray:
    """Return the variable of the drawing; a wave's angle within one period."""
    cycles, x = _cycles(written), written.shown.x
    return np.mod(x, 2.0 * np.pi / cycles) if cycles else x


def _curve(x: FloatArray, law: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places along x, and the 10 to 90 % range of the law at each, by its other variables."""
    first, last = (float(v) for v in np.quantile(x, [0.002, 0.998]))
    edges = np.linspace(first, last, _CURVE + 1)
    which = np.clip(np.searchsorted(edges, x) - 1, 0, _CURVE - 1)
    centre = 0.5 * (edges[1:] + edges[:-1])
    low, high = np.full(_CURVE, np.nan), np.full(_CURVE, np.nan)
    for k in range(_CURVE):
        inside = law[which == k]
        if len(inside):
            low[k], high[k] = np.quantile(inside, [0.1, 0.9])
    keep = np.isfinite(low)
    return centre[keep], low[keep], high[keep]


def _bin_means(x: FloatArray, y: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of y near each centre with its 95 % half-width, nan where few points are."""
    edges = np.concatenate([[-np.inf], 0.5 * (centre[1:] + centre[:-1]), [np.inf]])
    which = np.searchsorted(edges, x) - 1
    count = np.bincount(which, minlength=len(centre))[: len(centre)]
    mean = np.bincount(which, y, len(centre))[: len(centre)] / np.maximum(count, 1)
    square = np.bincount(which, y * y, len(centre))[: len(centre)] / np.maximum(count, 1)
    error = Z95 * np.sqrt(np.maximum(square - mean**2, 0.0) / np.maximum(count, 1))
    return np.where(count > 4, mean, np.nan), error


def time_figure(written: WrittenLaw) -> Figure:
    """Return the missing torque and the law over time."""
    shown, unit = written.shown, "rad" if written.law.place == "encoder" else "N m"
    hover = f"%{{y:.3g}} {words.unit(unit)}"
    data = [
        line(shown.t, shown.values, "missing", MEASURED, 1.0, hovertemplate=hover),
        line(shown.t, shown.law, "law", AFTER, 1.4, hovertemplate=hover),
    ]
    ends = [label("missing", 1.0, 0.85, MEASURED, xref="paper", yref="paper", xshift=6),
            label("law", 1.0, 0.72, AFTER, xref="paper", yref="paper", xshift=6)]  # fmt: skip
    middle = float(shown.t[len(shown.t) // 2])
    return Figure(
        "The same over time", "Drag to look closer, double click to see all.", data,
        layout(xaxis=axis("time, s", range=[middle, min(middle + 3.0, float(shown.t[-1]))]),
               yaxis=axis(words.unit(unit)), annotations=ends),
        300,
    )  # fmt: skip
