"""Figures of a law: the missing torque and the law over its variable, and both over time."""

from collections.abc import Sequence

import numpy as np

from rsea_ros.laws.law import WrittenLaw
from rsea_ros.records.record import FloatArray, IntArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.law.words import NAMES, UNITS

_WINDOWS = 12
_CURVE = 160


def over_figure(written: WrittenLaw) -> fig.Figure:
    """Return the missing torque and the law over the law's variable; a wave's angle within one period."""
    shown, law, x, y = written.shown, written.law, written.shown.x, written.shown.values
    cycles = [p.shape for p in law.parts if p.term.shape == "cycles_per_revolution" and shown.over == "theta"]
    if cycles and cycles[0]:
        x = np.mod(x, 2.0 * np.pi / cycles[0])
    quantity, unit = ("angle", "rad") if law.place == "encoder" else ("torque", words.unit("N m"))
    centre, low, high = _curve(x, shown.law)
    middle, error = _bin_means(x, y, centre)
    mean = np.flatnonzero(np.isfinite(middle))[::6]
    windows = np.array_split(np.argsort(shown.t), _WINDOWS)

    def cloud(k: IntArray | slice, colour: str, size: float, name: str, visible: bool = True) -> fig.Json:
        look = {"marker": {"size": size, "color": colour}, "visible": visible, "hoverinfo": "skip"}
        return fig.points(fig.numbers(x[k]), fig.numbers(y[k]), name, **look)

    sides: fig.Json = {"type": "data", "array": fig.numbers(error[mean]), "thickness": 1.2, "width": 0,
                       "color": fig.INK}  # fmt: skip
    data: list[fig.Json] = [
        cloud(slice(None), fig.faint(fig.MEASURED, 0.28), 3.5, "measured"),
        *(cloud(k, fig.faint(fig.BEFORE, 0.85), 5, "", i == 0) for i, k in enumerate(windows)),
        fig.band(centre, low, high, fig.faint(fig.AFTER, 0.16)),
        fig.points(fig.numbers(centre[mean]), fig.numbers(middle[mean]), "mean",
                   marker={"size": 6, "color": fig.INK}, error_y=sides),
        fig.line(centre, 0.5 * (low + high), "law", fig.AFTER, 2.6, hovertemplate=f"%{{y:.3g}} {unit}"),
    ]  # fmt: skip
    top = 1.15 * float(np.quantile(np.abs(y), 0.995))
    wave = "one period of the " if cycles and cycles[0] else ""
    return fig.Figure(
        f"The missing {quantity} over the {NAMES[shown.over]}, and the law in it",
        f"Grey: missing in the simulation, point by point (one sigma {shown.sd:.2g} {unit}). Black: its "
        "mean with 95 %. Blue: the law; its band is the spread from its other variables. The slider shows "
        "one stretch of time in orange.",
        data,
        fig.layout(
            xaxis=fig.axis(f"{wave}{NAMES[shown.over]}, {words.unit(UNITS[shown.over])}"),
            yaxis=fig.axis(f"missing, {unit}", range=[-top, top]),
            hovermode="closest", sliders=[_slider(shown.t, windows)],
            margin={"l": 64, "r": 24, "t": 12, "b": 96},
        ),
        560,
    )  # fmt: skip


def _slider(t: FloatArray, windows: Sequence[IntArray]) -> fig.Json:
    """Return the slider that shows one window of the record at a time. windows: indices into t (s)."""
    steps = [
        {"label": f"{t[k[0]]:.0f}", "method": "restyle",
         "args": ["visible", [True, *(j == i for j in range(len(windows))), True, True, True]]}
        for i, k in enumerate(windows)
    ]  # fmt: skip
    small = {"size": 12, "color": fig.QUIET}
    value = {"prefix": "orange: from ", "suffix": " s on", "font": small}
    return {"active": 0, "currentvalue": value, "steps": steps, "pad": {"t": 44}, "len": 1.0, "x": 0.0,
            "tickcolor": fig.QUIET, "font": small}  # fmt: skip


def _curve(x: FloatArray, law: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places along x, and the 10 to 90 % range of the law at each, by its other variables."""
    first, last = np.quantile(x, [0.002, 0.998])
    edges = np.linspace(first, last, _CURVE + 1)
    which = np.clip(np.searchsorted(edges, x) - 1, 0, _CURVE - 1)
    places = np.unique(which)
    low, high = (np.array([np.quantile(law[which == k], q) for k in places]) for q in (0.1, 0.9))
    return 0.5 * (edges[1:] + edges[:-1])[places], low, high


def _bin_means(x: FloatArray, y: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of y near each centre with its 95 % half-width, nan where few points are."""
    edges = np.concatenate([[-np.inf], 0.5 * (centre[1:] + centre[:-1]), [np.inf]])
    which = np.searchsorted(edges, x) - 1
    count = np.bincount(which, minlength=len(centre))[: len(centre)]
    mean = np.bincount(which, y, len(centre))[: len(centre)] / np.maximum(count, 1)
    square = np.bincount(which, y * y, len(centre))[: len(centre)] / np.maximum(count, 1)
    error = Z95 * np.sqrt(np.maximum(square - mean**2, 0.0) / np.maximum(count, 1))
    return np.where(count > 4, mean, np.nan), error


def time_figure(written: WrittenLaw) -> fig.Figure:
    """Return the missing torque and the law over time."""
    shown, unit = written.shown, words.unit("rad" if written.law.place == "encoder" else "N m")
    curves = (("missing", shown.values, fig.MEASURED, 1.0), ("law", shown.law, fig.AFTER, 1.4))
    data = [
        fig.line(shown.t, y, name, colour, w, hovertemplate=f"%{{y:.3g}} {unit}")
        for name, y, colour, w in curves
    ]
    names = fig.names_beside([(name, colour) for name, _, colour, _ in curves], 0.13)
    middle = float(shown.t[len(shown.t) // 2])
    across = fig.axis("time, s", range=[middle, min(middle + 3.0, float(shown.t[-1]))])
    plane = fig.layout(xaxis=across, yaxis=fig.axis(unit), annotations=names)
    return fig.Figure("The same over time", "Drag to look closer, double click to see all.", data, plane, 300)
