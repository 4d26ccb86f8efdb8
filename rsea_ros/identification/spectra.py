"""Spectra of overlapping segments, and the falling spectrum that comes nearest to them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.records.record import ComplexArray, FloatArray

OVERLAP = 1.056
"""Segments that overlap by half, over as many independent ones (Welch, IEEE Trans. AU-15, 1967)."""
HANN = 1.5
"""Lines that share what one independent line would have, behind a Hann window."""
_BANDS = 20
TOP = 0.96
"""Of the Nyquist frequency: the highest line of all bands."""


def segment_spectra(values: FloatArray, longest: int, fewest: int) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments without their means, shape (segments, lines).

    longest: samples in a segment, a power of two. fewest: number of segments that fit side by side.
    Scaled so that white noise has the square of its RMS in every line.
    """
    length = min(longest, 2 ** math.floor(math.log2(max(len(values), 8 * fewest) / fewest)))
    segments = np.lib.stride_tricks.sliding_window_view(values, length)[:: length // 2]
    window = np.hanning(length + 1)[:-1]
    centred = (segments - segments.mean(axis=1, keepdims=True)) * window
    spectra: ComplexArray = rfft(centred, axis=1) / math.sqrt(float(window @ window))
    return spectra


@dataclass(frozen=True)
class SpectralShape:
    """A spectrum that never rises with frequency. share: of the Nyquist frequency. level: power, falling.

    off: standard deviations by which the worst band of the measured spectrum lies off it.
    """

    share: FloatArray
    level: FloatArray
    off: float

    def at(self, share: FloatArray) -> FloatArray:
        """Return the level at shares of the Nyquist frequency."""
        least = np.maximum(share, self.share[0])
        result: FloatArray = np.exp(np.interp(np.log(least), np.log(self.share), np.log(self.level)))
        return result

    def whiten(self, values: FloatArray) -> FloatArray:
        """Return values divided by the shape's amplitude at every frequency."""
        spectrum = rfft(values)
        gain = 1.0 / np.sqrt(self.at(np.linspace(0.0, 1.0, len(spectrum))))
        white: FloatArray = irfft(spectrum * gain, len(values))
        return white


def shape_of(spectra: ComplexArray) -> SpectralShape:
    """Return the falling spectrum nearest to the mean of some segments', in bands of equal ratio."""
    lines = spectra.shape[1]
    edges = np.unique(np.append(1, np.round(np.geomspace(2, TOP * lines, _BANDS)).astype(np.int64)))
    mean, count = np.mean(np.abs(spectra) ** 2, axis=0), np.diff(edges)
    measured = np.maximum(np.add.reduceat(mean[: edges[-1]], edges[:-1]) / count, 1e-300)
    freedom = 1.8 * count * len(spectra) / OVERLAP / np.where(count > 2, HANN, 1.0)
    level = fit_falling(measured, freedom)
    off = float(np.max(np.abs(np.log(measured / level)) * np.sqrt(freedom / 2.0)))
    return SpectralShape(np.sqrt(edges[:-1] * (edges[1:] - 1.0)) / (lines - 1.0), level, off)


def fit_falling(levels: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the sequence nearest to `levels` that never rises (pool adjacent violators), shape of levels."""
    pools: list[tuple[float, float, int]] = []
    for level, weight in zip(levels, weights, strict=True):
        pool = (float(level), float(weight), 1)
        while pools and pools[-1][0] < pool[0]:
            (a, w, n), (b, v, m) = pools.pop(), pool
            pool = ((a * w + b * v) / (w + v), w + v, n + m)
        pools.append(pool)
    return np.repeat([p[0] for p in pools], [p[2] for p in pools])
