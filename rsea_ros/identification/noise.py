"""The noise floor of a channel, from the data alone.

White sensor noise is all that is left at the top of the band of a torque-driven actuator once what follows
the command linearly has been taken away: S_nn = (1 - coherence) S_yy, median over the top of the band.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

from rsea_ros.signals import Channel, FloatArray, Record

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
    u = _held_before(record["command"], t - 0.25 * period)
    length = int(min(512, 2 ** math.floor(math.log2(len(y) / 8))))
    frequency, s_yy = signal.welch(y, 1.0 / period, nperseg=length)
    _, coherence = signal.coherence(u, y, 1.0 / period, nperseg=length)
    segments = max(2.0, 2.0 * len(y) / length - 1.0)
    band = (frequency > TOP_OF_BAND[0] * 0.5 / period) & (frequency < TOP_OF_BAND[1] * 0.5 / period)
    level = float(np.median((1.0 - coherence[band]) * s_yy[band])) / (1.0 - 1.8 / segments)
    return max(math.sqrt(level * 0.5 / period), least)


def residual_floor(residual: FloatArray, period: float) -> float:
    """Return the RMS of white noise with the level that a model's residual has at the top of the band."""
    length = int(min(512, 2 ** math.floor(math.log2(max(len(residual), 64) / 8))))
    frequency, level = signal.welch(residual, 1.0 / period, nperseg=min(length, len(residual)))
    band = frequency > TOP_OF_BAND[0] * 0.5 / period
    return math.sqrt(float(np.median(level[band])) * 0.5 / period)


def _finite(channel: Channel) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(channel.y) & np.isfinite(channel.t)
    return channel.t[good], channel.y[good]


def _held_before(command: Channel, t: FloatArray) -> FloatArray:
    """Return the command that was held just before each instant."""
    index = np.clip(np.searchsorted(command.t, t, side="right") - 1, 0, len(command) - 1)
    return np.nan_to_num(command.y[index])
