"""Measured against simulated over time, residual beneath. Drawn coarse, and from all samples on zoom."""

import base64
import gzip
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.records.record import FloatArray
from rsea_ros.report.figures import figure as fig

MOST_SAMPLES = 45_000
"""Of a trace in the page: the paper's 160 s at 280 Hz. A longer one keeps its and the residual's extremes."""
_MEASURED, _RESIDUAL = 1.0 / 2000.0, 1.0 / 64.0
"""Steps of the drawn values, of their standard deviation: an eighth of a pixel, also of a tenfold zoom."""
_MICROSECOND = 1e-6
STEPS = 60_000
"""Of the whole range of a packed trace, at the least: 16 bits hold them."""
_PAUSE, _PERIODS = 1.0, 10.0
"""s, and sample periods: a longer pause of the samples shows as a gap of the line."""


def overlay_figure(
    title: str, what: str, unit: str, t: FloatArray, measured: FloatArray, simulations: Sequence[fig.Curve],
    view: float = 6.0, lively: FloatArray | None = None,
) -> fig.Figure:  # fmt: skip
    """Return the figure of one channel, or of something else. t: stamps of its values, s.

    It opens with the `view` s in which a signal moves most. lively: that signal, by default the measured one.
    """
    keep = extremes(MOST_SAMPLES, measured, measured - simulations[-1].values)
    pauses = pauses_of(t[keep])
    shown = measured[keep]
    shown[list(pauses)] = np.nan

    def residual(simulated: fig.Curve) -> fig.Json:
        values = shown - simulated.values[keep]
        y = pack(values, _fineness(values, _RESIDUAL))
        return {"name": simulated.name, "colour": simulated.colour, "y": y}

    extra = {
        "t": pack(without(pauses, t[keep] - t[0]), _MICROSECOND),
        "pauses": list(pauses.items()),
        "measured": {"colour": fig.MEASURED, "y": pack(shown, _fineness(measured, _MEASURED))},
        "residuals": [residual(s) for s in simulations],
        "unit": unit,
    }
    caption = "Drag to zoom, double-click to see the whole record; every zoom draws all samples."
    opening = _liveliest(t - t[0], measured if lively is None else lively, view)
    drawn = _layout(f"{what}, {unit}", unit, simulations, opening)
    return fig.Figure(title, caption, [], drawn, 460, "overlay", extra)


def pauses_of(t: FloatArray) -> dict[int, float]:
    """Return the length (s) of each pause of the samples by the number of the sample behind it.

    That sample is not drawn, so that no line crosses a pause.
    """
    steps = np.diff(t)
    usual = float(np.median(steps)) if len(steps) else 0.0
    return {int(k) + 1: float(steps[k]) for k in np.flatnonzero(steps > max(_PAUSE, _PERIODS * usual))}


def without(pauses: Mapping[int, float], t: FloatArray) -> FloatArray:
    """Return stamps less the pauses before them: those of ten minutes' stretches lie on no line to pack."""
    lost = np.zeros(len(t))
    lost[list(pauses)] = list(pauses.values())
    return np.asarray(t - np.cumsum(lost))


def _fineness(values: FloatArray, part: float) -> float:
    """Return the step that a trace may be rounded to: a part of its standard deviation."""
    return part * float(np.nanstd(values)) if np.isfinite(values).any() else 0.0


def extremes(most: int, *signals: FloatArray) -> npt.NDArray[np.int64]:
    """Return the indices that stay of traces that are too long: the extremes of each in each block.

    most: samples. Not-a-number is never an extreme.
    """
    n, block = len(signals[0]), -(-2 * len(signals) * len(signals[0]) // most)
    if n <= most:
        return np.arange(n)
    starts = np.arange(0, n - block + 1, block)
    levels = (np.where(np.isnan(v), -np.inf, sign * v) for v in signals for sign in (-1.0, 1.0))
    blocks = (level[: len(starts) * block].reshape(-1, block) for level in levels)
    return np.unique(np.concatenate([*(starts + b.argmax(axis=1) for b in blocks), [n - 1]]))


def _liveliest(t: FloatArray, signal: FloatArray, view: float) -> tuple[float, float]:
    if t[-1] <= 2.0 * view:
        return 0.0, float(t[-1])
    edges = np.searchsorted(t, np.arange(0.0, t[-1], view))
    start = view * int(np.argmax(np.add.reduceat((signal - signal.mean()) ** 2, edges)[:-1]))
    return start, start + view


def _layout(what: str, unit: str, simulations: Sequence[fig.Curve], view: tuple[float, float]) -> fig.Json:
    names = fig.names_beside(
        [("measured", fig.MEASURED), *((f"<b>{s.name}</b>", s.colour) for s in simulations)], 0.055, 1.01
    )
    last: fig.Json = {"xref": "paper", "yref": "paper", "yanchor": "top"}
    names.append(fig.label("residual", 1.01, 0.22, simulations[-1].colour, **last))
    title, zero = {"text": "%{x} s"}, fig.faint(fig.MEASURED, 0.4)
    return fig.layout(
        xaxis=fig.axis("time, s", anchor="y2", range=list(view), hoverformat=".3f", unifiedhovertitle=title),
        yaxis=fig.axis(what, domain=[0.3, 1.0]),
        yaxis2=fig.axis(f"residual, {unit}", domain=[0.0, 0.22], zeroline=True, zerolinecolor=zero),
        annotations=names,
        hoversubplots="axis",
        margin={"l": 72, "r": 110, "t": 12, "b": 48},
    )


def pack(values: FloatArray, step: float = 0.0) -> dict[str, Any]:
    """Return values in few bytes for page.js: value k = first + slope·k + step·(whole number k).

    step: allowed rounding, in the unit of the values; 0: the resolution of 16 bits. Not-a-number becomes a
    gap. The line goes through the ends: stamps lie on it but for their jitter.
    """
    values, first, slope = np.asarray(values, dtype=float), 0.0, 0.0
    if len(values) >= 2 and np.isfinite(values[[0, -1]]).all():
        first, slope = float(values[0]), float(values[-1] - values[0]) / (len(values) - 1)
    off = values - (first + slope * np.arange(len(values)))
    known = np.isfinite(off)
    low, high = (float(off[known].min()), float(off[known].max())) if known.any() else (0.0, 0.0)
    step = max(step, (high - low) / STEPS) or 1.0
    whole = np.where(known, np.round((off - low) / step), 2.0**16 - 1.0).astype("<u2")
    planes = np.concatenate([whole & 0xFF, whole >> 8]).astype(np.uint8)
    data = base64.b64encode(gzip.compress(planes.tobytes(), 6, mtime=0)).decode("ascii")
    return {"first": first + low, "slope": slope, "step": step, "data": data}
