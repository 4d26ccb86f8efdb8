"""Amplitude spectral density of residuals against the noise floor."""

from collections.abc import Sequence

import numpy as np

from rsea_ros.records.record import UNITS, FloatArray
from rsea_ros.records.statistics import stamped_density
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig

_PER_DECADE = 40
_LONGEST = 4096
_STANDS, _LIES = 2.0, 1.1
"""Times the noise floor: from which a band stands above it and does not merely scatter, and all bands lie."""
_TINY = 1e-300


def residual_figure(
    title: str, channel: str, frequency: FloatArray, curves: Sequence[fig.Curve], noise: float,
    caption: str = "",
) -> fig.Figure:  # fmt: skip
    """Return the densities of residuals (unit/√Hz) over frequency, Hz. noise: that of the noise floor."""
    unit, floor, ends = words.unit(UNITS[channel]), np.full(2, noise), frequency[[0, -1]]
    drawn = [(c, *in_bands(frequency, c.values)) for c in curves]
    data: list[fig.Json] = [fig.line(ends, floor, "noise floor", fig.NOISE, 6.0, hoverinfo="skip")]
    data += [
        fig.line(f, d, c.name, c.colour, 1.8, hovertemplate=f"%{{y:.3g}} {unit}/√Hz") for c, f, d in drawn
    ]
    exponents = np.log10(np.maximum(np.concatenate([*(d for _, _, d in drawn), floor]), _TINY))
    low, high = float(exponents.min()), float(exponents.max())
    lacking = max(0.0, 2.0 - (high - low)) / 2.0  # two decades at least
    reach = [low - lacking - 0.1, high + lacking + 0.3]
    height = fig.axis(f"density, {unit}/√Hz", type="log", dtick=1, exponentformat="power", range=reach)
    names = fig.names_beside(
        [*((f"<b>{c.name}</b>", c.colour) for c in curves), ("noise floor", fig.QUIET)], 0.075
    )
    across = fig.frequency_axis(frequency[0], frequency[-1])
    return fig.Figure(title, caption, data, fig.layout(xaxis=across, yaxis=height, annotations=names), 380)


def density(t: FloatArray, residual: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Return rate and frequency, Hz, and the amplitude spectral density, unit/√Hz. t: stamps, s."""
    rate, frequency, power = stamped_density(t, residual, min(_LONGEST, 2 * (len(residual) // 8)))
    return rate, frequency[2:-1], np.sqrt(power)[2:-1]


def in_bands(frequency: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the RMS in bands of equal ratio, for drawing."""
    bands = np.floor(np.log10(frequency) * _PER_DECADE)
    starts = np.flatnonzero(np.diff(bands, prepend=-np.inf))
    count = np.diff(np.append(starts, len(frequency)))
    return np.add.reduceat(frequency, starts) / count, np.sqrt(np.add.reduceat(values**2, starts) / count)


def peak_above(frequency: FloatArray, values: FloatArray, noise: float) -> str:
    """Return `3.1 times at 29 Hz` of a density, the most over the noise floor; empty where it lies there."""
    f, d = in_bands(frequency, values)
    worst, over = int(np.argmax(d)), max(noise, _TINY)
    if d[worst] < _STANDS * over and float(np.sqrt(np.mean(values**2))) < _LIES * over:
        return ""
    return f"{words.number(d[worst] / over, 2)} times at {words.number(f[worst], 2)} Hz"


def finding(frequency: FloatArray, values: FloatArray, noise: float, channel: str) -> str:
    """Return the sentence: at the noise floor, or where above it the most."""
    if not (peak := peak_above(frequency, values, noise)):
        return words.sentence(f"{channel}: the residual lies at the noise floor at all frequencies")
    f, d = in_bands(frequency, values)
    above = f[d > _STANDS * max(noise, _TINY)]
    where = "lies above the noise floor"
    if len(above):
        band = f"{words.number(above[0], 2)} to {words.number(above[-1], 2)} Hz"
        where = f"stands above the noise floor from {band}"
    return words.sentence(f"{channel}: the residual {where}, at most {peak}")
