"""Measured against simulated over time, residual beneath. Drawn coarse, and from all samples on zoom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rsea_ros.records.record import UNITS, FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, Json, axis, label, layout
from rsea_ros.report.figures.packing import pack
from rsea_ros.report.figures.palette import MEASURED, faint

MOST_SAMPLES = 45_000
"""Of a trace in the page: the paper's 160 s at 280 Hz. A longer one keeps its and the residual's extremes."""
_MEASURED, _RESIDUAL = 1.0 / 2000.0, 1.0 / 64.0
"""Steps of the drawn values, of their standard deviation: an eighth of a pixel, also of a tenfold zoom."""
_MICROSECOND = 1e-6
_FIRST_VIEW = 6.0
_PAUSE, _PERIODS = 1.0, 10.0
"""s, and sample periods: a longer pause of the samples shows as a gap of the line."""


@dataclass(frozen=True)
class Simulated:
    """A simulation of the channel at the measurement's stamps: its name on the page, its colour, values."""

    name: str
    colour: str
    values: FloatArray


def overlay_figure(
    title: str,
    channel: str,
    t: FloatArray,
    measured: FloatArray,
    simulations: Sequence[Simulated],
    caption: str = "",
) -> Figure:
    """Return the figure of one channel. t: s."""
    keep = sample_extremes(measured, measured - simulations[-1].values)
    unit = words.unit(UNITS[channel])
    pauses = pauses_of(t[keep])
    shown = measured[keep]
    shown[list(pauses)] = np.nan
    extra = {
        "t": pack(without(pauses, t[keep] - t[0]), _MICROSECOND),
        "pauses": list(pauses.items()),
        "measured": {"colour": MEASURED, "y": pack(shown, _fineness(measured, _MEASURED))},
        "residuals": [_residual(s, shown - s.values[keep]) for s in simulations],
        "unit": unit,
    }
    return Figure(
        title=title,
        caption=caption
        or "Drag to zoom, double-click to see the whole record; every zoom draws all samples.",
        data=[],
        layout=_layout(channel, unit, simulations, _liveliest(t - t[0], measured)),
        height=460,
        kind="overlay",
        extra=extra,
    )


def pauses_of(t: FloatArray) -> dict[int, float]:
    """Return the length (s) of each pause of the samples by the number of the sample behind it.

    That sample is not drawn, so that no line crosses a pause.
    """
    steps = np.diff(t)
    usual = float(np.median(steps)) if len(steps) else 0.0
    behind = np.flatnonzero(steps > max(_PAUSE, _PERIODS * usual))
    return {int(k) + 1: float(steps[k]) for k in behind}


def without(pauses: Mapping[int, float], t: FloatArray) -> FloatArray:
    """Return stamps less the pauses before them: those of ten minutes' stretches lie on no line to pack."""
    lost = np.zeros(len(t))
    lost[list(pauses)] = list(pauses.values())
    return np.asarray(t - np.cumsum(lost))


def _residual(simulated: Simulated, values: FloatArray) -> Json:
    return {
        "name": simulated.name,
        "colour": simulated.colour,
        "y": pack(values, _fineness(values, _RESIDUAL)),
    }


def _fineness(values: FloatArray, part: float) -> float:
    """Return the step that a trace may be rounded to: a part of its standard deviation."""
    return part * float(np.nanstd(values)) if np.isfinite(values).any() else 0.0


def sample_extremes(measured: FloatArray, residual: FloatArray) -> npt.NDArray[np.int64]:
    """Return the indices that stay when a trace is too long: the extremes of both in each block."""
    n = len(measured)
    if n <= MOST_SAMPLES:
        return np.arange(n)
    block = -(-4 * n // MOST_SAMPLES)
    starts = np.arange(0, n - block + 1, block)
    kept = [starts + np.argmax(sign * v[: len(starts) * block].reshape(-1, block), axis=1)
            for v in (measured, residual) for sign in (-1.0, 1.0)]  # fmt: skip
    return np.unique(np.concatenate([*kept, [n - 1]]))


def _liveliest(t: FloatArray, measured: FloatArray) -> tuple[float, float]:
    """Return the stretch in which the channel moves most, where the figure opens."""
    if t[-1] <= 2.0 * _FIRST_VIEW:
        return 0.0, float(t[-1])
    edges = np.searchsorted(t, np.arange(0.0, t[-1], _FIRST_VIEW))
    spread = np.add.reduceat((measured - measured.mean()) ** 2, edges)[:-1]
    start = _FIRST_VIEW * int(np.argmax(spread))
    return start, start + _FIRST_VIEW


def _layout(channel: str, unit: str, simulations: Sequence[Simulated], view: tuple[float, float]) -> Json:
    names = [label("measured", 1.01, 1.0, MEASURED, xref="paper", yref="paper", yanchor="top")]
    for i, s in enumerate(simulations):
        y = 1.0 - 0.055 * (i + 1)
        names.append(label(f"<b>{s.name}</b>", 1.01, y, s.colour, xref="paper", yref="paper", yanchor="top"))
    names.append(
        label("residual", 1.01, 0.22, simulations[-1].colour, xref="paper", yref="paper", yanchor="top")
    )
    return layout(
        xaxis=axis(
            "time, s", anchor="y2", range=list(view), hoverformat=".3f", unifiedhovertitle={"text": "%{x} s"}
        ),
        yaxis=axis(f"{words.channel(channel)}, {unit}", domain=[0.3, 1.0]),
        yaxis2=axis(
            f"residual, {unit}", domain=[0.0, 0.22], zeroline=True, zerolinecolor=faint(MEASURED, 0.4)
        ),
        annotations=names,
        hoversubplots="axis",
        margin={"l": 72, "r": 110, "t": 12, "b": 48},
    )
