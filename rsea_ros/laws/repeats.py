"""Repetition: periods of the missing torque over the rotor's angle, and lines of a residual over time."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import periodogram, welch

from rsea_ros.diagnosis.residual_peaks import interpolate_peak, peaks
from rsea_ros.records.record import FloatArray

_MOST = 400.0
"""Cycles over the travel at most: more than that no record resolves."""
_TURNS = 2.5
"""As often a wave must have repeated over the travel."""
_BINS = 4096
_LOWEST, _HIGHEST = 1.0, 0.45
"""Hz, and share of the rate, between which lines are looked for."""


def periods(angle: FloatArray, torque: FloatArray, factor: FloatArray | None = None) -> list[float]:
    """Return cycles per radian-turn of the waves that the torque follows best over an angle, at most two.

    angle: rad, of the rotor. factor: what multiplies the waves, such as the deflection of a spring whose
    stiffness repeats; without it, such a wave shows as two lines beside its true one. The torque is averaged
    in bins of the angle, which removes parts that follow time only.
    """
    travel = float(np.ptp(angle))
    if travel <= 0.0:
        return []
    at = np.minimum(((angle - angle.min()) / travel * _BINS).astype(np.int64), _BINS - 1)
    count = np.bincount(at, minlength=_BINS)
    mean = np.bincount(at, torque, _BINS) / np.maximum(count, 1)
    weight = np.sqrt(np.minimum(count, np.median(count[count > 0])))
    x = np.linspace(-1.0, 1.0, _BINS)
    trend = np.polyval(np.polyfit(x, mean, 3, w=weight + 1e-9), x)
    wave = (mean - trend) * weight
    if factor is not None:
        wave *= np.bincount(at, factor, _BINS) / np.maximum(count, 1)
    level = np.abs(np.fft.rfft(wave, 8 * _BINS)) ** 2
    cycles = np.arange(len(level)) / 8.0
    level = np.where((cycles > _TURNS) & (cycles < _MOST), level, 0.0)
    if not level.any():
        return []
    return [interpolate_peak(cycles, level, k) * 2.0 * math.pi / travel for k in peaks(level, apart=16)]


def lines(t: FloatArray, residual: FloatArray) -> list[float]:
    """Return the sharpest line of a residual's spectrum over time, Hz, in a list."""
    rate = 1.0 / float(np.median(np.diff(t)))
    bins, level = periodogram(residual, rate, window="hann")
    level = np.where((bins > _LOWEST) & (bins < _HIGHEST * rate), level, 0.0)
    return [interpolate_peak(bins, level, k) for k in peaks(level, apart=8)[:1]]


def modes(t: FloatArray, residual: FloatArray) -> list[float]:
    """Return the frequencies of the highest broad peaks of a residual's spectrum, Hz, at most two."""
    rate = 1.0 / float(np.median(np.diff(t)))
    bins, level = welch(residual, rate, nperseg=min(1024, len(residual)))
    level = np.where((bins > _LOWEST) & (bins < _HIGHEST * rate), level, 0.0)
    return [interpolate_peak(bins, level, k) for k in peaks(level, apart=12)]
