"""The noise floor of a channel, from the data alone.

White sensor noise is all that is left at the top of the band of a torque-driven actuator once what follows
the command linearly has been taken away: S_nn = (1 - coherence) S_yy, median over the top of the band.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.fft import rfft

from rsea_ros.signals import Channel, ComplexArray, FloatArray, Record

_TINY = 1e-300
TOP_OF_BAND = (0.62, 0.98)
"""Of the Nyquist frequency: where the noise is read off."""


def noise_floor(record: Record, name: str, quantum: float = 0.0) -> float:
    """Return the RMS of a channel's noise, in its unit: white noise with the level at the top of the band.

    quantum: of the sensor; half of it is the least that is returned: no model is asked for more.
    """
    t, y = _finite(record[name])
    least = max(0.5 * quantum, 1e-9 * float(np.std(y)), 1e-300)
    if len(y) < 64:
        return max(float(np.std(np.diff(y, 2))) / math.sqrt(6.0) if len(y) > 3 else 0.0, least)
    period = float(np.median(np.diff(t)))
    u, v = _spectra(_held_before(record["command"], t - 0.25 * period)), _spectra(y)
    power = np.mean(np.abs(v) ** 2, axis=0)
    shared = np.abs(np.mean(v * u.conj(), axis=0)) ** 2 / (np.mean(np.abs(u) ** 2, axis=0) + _TINY)
    unlike = (power - shared) / (1.0 - 1.8 / max(2.0, len(v)))
    return max(math.sqrt(float(np.median(unlike[_top(unlike)]))), least)


def residual_floor(residual: FloatArray) -> float:
    """Return the RMS of white noise with the level that a model's residual has at the top of the band."""
    power = np.mean(np.abs(_spectra(residual)) ** 2, axis=0)
    return math.sqrt(float(np.median(power[_top(power)])))


def _spectra(values: FloatArray) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments, shape (segments, lines).

    Scaled so that white noise has the square of its RMS in every line.
    """
    length = min(512, 2 ** math.floor(math.log2(max(len(values), 64) / 8)))
    segments = np.lib.stride_tricks.sliding_window_view(values, length)[:: length // 2]
    window = np.hanning(length + 1)[:-1]
    centred = (segments - segments.mean(axis=1, keepdims=True)) * window
    spectra: ComplexArray = rfft(centred, axis=1) / math.sqrt(float(window @ window))
    return spectra


def _top(lines: FloatArray) -> slice:
    """Return where the top of the band lies: one line at least."""
    first, last = math.ceil(TOP_OF_BAND[0] * len(lines)), math.floor(TOP_OF_BAND[1] * len(lines))
    return slice(first, max(last, first + 1))


def _finite(channel: Channel) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(channel.y) & np.isfinite(channel.t)
    return channel.t[good], channel.y[good]


def _held_before(command: Channel, t: FloatArray) -> FloatArray:
    """Return the command that was held just before each instant."""
    index = np.clip(np.searchsorted(command.t, t, side="right") - 1, 0, len(command) - 1)
    return np.nan_to_num(command.y[index])
