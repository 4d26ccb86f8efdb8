"""Frequency response by local polynomials, and the lines on which it stands.

In a narrow band around line k both the response and the transient are smooth, and the command is not:

    Y(k + r) = (g_0 + g_1 r + g_2 r^2) U(k + r) + t_0 + t_1 r + t_2 r^2 + noise,   r = -n … n

Least squares over the band gives G(k) = g_0, its variance from the residual, and the noise.
(Schoukens, Vandersteen, Barbe, Pintelon, "Nonparametric preprocessing in system identification",
European Journal of Control 15, 2009.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.fft import rfft

from rsea_ros.identification.resample import Aligned, AtRestError
from rsea_ros.records.record import ComplexArray, FloatArray


@dataclass(frozen=True)
class Lines:
    """A sampled response, all shape (n,).

    frequency: Hz. response: output per held command. sd: of the complex response, widened for few degrees
    of freedom. coherence: 0 … 1. noise, distortion: RMS of the output in one line, see FrequencyResponse.
    """

    method: str
    frequency: FloatArray
    response: ComplexArray
    sd: FloatArray
    coherence: FloatArray
    noise: FloatArray | None = None
    distortion: FloatArray | None = None

    def up_to(self, highest: float) -> Lines:
        """Return the lines up to a frequency, Hz."""
        n = int(np.searchsorted(self.frequency, highest, side="right"))
        return Lines(
            method=self.method,
            frequency=self.frequency[:n],
            response=self.response[:n],
            sd=self.sd[:n],
            coherence=self.coherence[:n],
            noise=None if self.noise is None else self.noise[:n],
            distortion=None if self.distortion is None else self.distortion[:n],
        )


def widen(sd: FloatArray, freedom: FloatArray | float) -> FloatArray:
    """Return sd scaled so that the circle of radius 1.73 sd holds the truth in 95 % of cases.

    With the variance itself estimated from m = `freedom` complex values, |error|^2 / variance follows
    F(2, 2 m), which exceeds x with probability (1 + x / m)^-m; for a known variance with e^-x, so that its
    95 % point is -ln 0.05 = 1.73^2.
    """
    m = np.maximum(freedom, 1.0)
    quantile = m * (0.05 ** (-1.0 / m) - 1.0)
    result: FloatArray = sd * np.sqrt(quantile / -np.log(0.05))
    return result


def detrend(values: FloatArray) -> FloatArray:
    """Return values without their mean and slope."""
    place = np.linspace(-1.0, 1.0, len(values))
    slope = float(place @ values / (place @ place))
    result: FloatArray = values - values.mean() - slope * place
    return result


_UNKNOWNS = 6
_TINY = 1e-300
_ROUNDING = 1e-14
"""Of the output's power: less noise than this cannot be distinguished from rounding."""
_NARROWEST = 8
_RELATIVE_BAND = 0.03
"""Half the band as a share of its frequency, where that is wider than _NARROWEST lines."""


def local_polynomial(aligned: Aligned) -> Lines:
    """Return the response of the longest stretch without a gap, at lines a quarter band apart.

    Raises AtRestError where the command changes in none.
    """
    stretch = _longest(aligned)
    n = stretch.stop - stretch.start
    u, y = (rfft(detrend(x[stretch])) / np.sqrt(n) for x in (aligned.command, aligned.output))
    bands = _bands(len(u))
    response, variance, noise, power = _estimates(u, y, bands)
    freedom = np.array([2 * half + 1 - _UNKNOWNS for _, half in bands])
    signal = np.abs(response) ** 2 * power
    return Lines(
        method="local polynomial",
        frequency=np.array([centre for centre, _ in bands]) / (n * aligned.period),
        response=response,
        sd=widen(np.sqrt(variance), freedom),
        coherence=signal / (signal + noise + 1e-300),
        noise=np.sqrt(2.0 * noise / n),
    )


def _longest(aligned: Aligned) -> slice:
    """Return the longest stretch that was measured throughout and in which the command changes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], aligned.measured.astype(np.int8), [0]])))
    stretches = [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    excited = [s for s in stretches if np.ptp(aligned.command[s]) > 0.0]
    if not excited:
        raise AtRestError(f"{aligned.name}: the command never changes where all is measured")
    return max(excited, key=lambda s: s.stop - s.start)


def _bands(lines: int) -> list[tuple[int, int]]:
    """Return centre and half-width of the bands, in lines; a quarter band apart."""
    bands, centre = [], _NARROWEST
    while centre < lines - 1:
        half = max(_NARROWEST, round(_RELATIVE_BAND * centre))
        bands.append((centre, half))
        centre += max(1, half // 2)
    return bands


def _estimates(
    u: ComplexArray, y: ComplexArray, bands: list[tuple[int, int]]
) -> tuple[ComplexArray, FloatArray, FloatArray, FloatArray]:
    """Return response, its variance, noise power and command power of all bands."""
    products = np.array([_products(u, y, centre, half) for centre, half in bands])
    scale = np.sqrt(np.einsum("bii->bi", products).real[:, :-1]) + _TINY
    inverse = np.linalg.pinv(products[:, :-1, :-1] / (scale[:, :, None] * scale[:, None]), hermitian=True)
    wanted = products[:, :-1, -1] / scale
    unknowns = np.einsum("bij,bj->bi", inverse, wanted)
    total = products[:, -1, -1].real
    residual = total - np.einsum("bi,bi->b", wanted.conj(), unknowns).real
    lines = np.array([2 * half + 1 for _, half in bands])
    noise = np.maximum(residual, _ROUNDING * total) / (lines - _UNKNOWNS)
    return (
        unknowns[:, 0] / scale[:, 0],
        noise * inverse[:, 0, 0].real / scale[:, 0] ** 2,
        noise,
        scale[:, 0] ** 2 / lines,
    )


def _products(u: ComplexArray, y: ComplexArray, centre: int, half: int) -> ComplexArray:
    """Return the inner products of all columns of a band and the output, shape (7, 7)."""
    first = min(max(1, centre - half), len(u) - 2 * half - 1)
    band = slice(first, first + 2 * half + 1)
    r = (np.arange(first, band.stop) - centre) / half
    powers = np.stack([np.ones(len(r)), r, r**2])
    rows = np.concatenate([powers * u[band], powers, y[band][None]])
    products: ComplexArray = rows.conj() @ rows.T
    return products
