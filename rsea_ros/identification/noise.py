"""The noise floor of a channel before any fit: from the record, and from the rig's statement on its sensor.

At the top of the band of a torque-driven actuator only white sensor noise remains once the linear response to
the command is removed: S_nn = (1 - coherence) S_yy, median over the top of the band. Where
that is not flat (a smoothed log) or the channel is slower than the command, so that the command's upper half
is folded over it, the record does not show its noise; the rig's statement counts until a fit has its
residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rsea_ros.identification.noise_settings import DEFAULT, NoiseSettings
from rsea_ros.identification.quantum import step_of
from rsea_ros.identification.spectra import segment_spectra
from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import BoolArray, Channel, ComplexArray, FloatArray, IntArray, Record

_TINY = 1e-300
_LONGEST, _SEGMENTS = 512, 8
_FEWEST = 64
_ROUNDING = 1e-9
"""Of a channel's standard deviation: less than this is rounding, not noise."""


def noise_floor(record: Record, name: str, sensor: Sensor, rule: NoiseSettings = DEFAULT) -> float:
    """Return the RMS of a channel's noise, in its unit: white noise with the level at the top of the band.

    sensor: as the rig states it; its statement counts where the record does not show the noise.
    """
    t, y = _finite(record[name])
    least = least_noise(y, sensor, rule)
    stated = math.hypot(sensor.noise, sensor.quantum / math.sqrt(12.0))
    if len(y) < _FEWEST:
        return max(float(np.std(np.diff(y, 2))) / math.sqrt(6.0) if len(y) > 3 else 0.0, stated, least)
    if stated > 0.0 and record[name].rate < rule.slower * record["command"].rate:
        return max(stated, least)
    unlike = _unlike(record["command"], t, y)
    level = math.sqrt(float(np.median(unlike[_top(unlike, rule)])))
    return max(level, least) if _is_flat(unlike, rule) else max(level, stated, least)


def least_noise(values: FloatArray, sensor: Sensor, rule: NoiseSettings = DEFAULT) -> float:
    """Return the least noise of a channel: no model has to fit better.

    Half the rig's quantum, or where the values come in steps larger than that, q / sqrt(12) of those; and a
    tenth of the noise that the rig states: a smaller one comes from a filter.
    """
    step = step_of(values)
    coarse = step / math.sqrt(12.0) if step > sensor.quantum else 0.0
    stated = max(0.5 * sensor.quantum, rule.filtered * sensor.noise)
    return max(stated, coarse, _ROUNDING * float(np.std(values)), _TINY)


def top_of_band(
    values: FloatArray, seams: Sequence[int] | IntArray = (), rule: NoiseSettings = DEFAULT
) -> tuple[float, bool]:
    """Return the RMS of white noise as high as the top of the band of values, and whether that is flat.

    seams: samples before which values are missing. A jump there would pass for noise.
    """
    spectra = segment_spectra(values, _LONGEST, _SEGMENTS)
    power = np.mean(np.abs(spectra[_seamless(spectra, seams)]) ** 2, axis=0)
    return math.sqrt(float(np.median(power[_top(power, rule)]))), _is_flat(power, rule)


def _seamless(spectra: ComplexArray, seams: Sequence[int] | IntArray) -> BoolArray:
    """Return which of half-overlapping segments have no seam inside; all where each has one."""
    half = spectra.shape[1] - 1
    first = half * np.arange(len(spectra))
    whole = np.searchsorted(seams, first, side="right") == np.searchsorted(seams, first + 2 * half)
    return whole if whole.any() else np.ones(len(spectra), bool)


def _unlike(command: Channel, t: FloatArray, y: FloatArray) -> FloatArray:
    """Return the power of a channel that does not follow the command linearly, by frequency."""
    period = float(np.median(np.diff(t)))
    u = segment_spectra(_held_before(command, t - 0.25 * period), _LONGEST, _SEGMENTS)
    v = segment_spectra(y, _LONGEST, _SEGMENTS)
    power = np.mean(np.abs(v) ** 2, axis=0)
    shared = np.abs(np.mean(v * u.conj(), axis=0)) ** 2 / (np.mean(np.abs(u) ** 2, axis=0) + _TINY)
    return np.asarray(np.maximum(power - shared, 0.0) / (1.0 - 1.8 / max(2.0, len(v))))


def _is_flat(power: FloatArray, rule: NoiseSettings) -> bool:
    """Return whether both halves of the top of the band have about the same power; one line is not enough."""
    top = power[_top(power, rule)]
    if len(top) < 2:
        return False
    lower, upper = (float(np.median(half)) for half in np.array_split(top, 2))
    return max(lower, upper) <= rule.flat * max(min(lower, upper), _TINY)


def _top(lines: FloatArray, rule: NoiseSettings) -> slice:
    """Return where the top of the band lies: one line at least."""
    first, last = math.ceil(rule.top_from * len(lines)), math.floor(rule.top_to * len(lines))
    return slice(first, max(last, first + 1))


def _finite(channel: Channel) -> tuple[FloatArray, FloatArray]:
    good = np.isfinite(channel.y) & np.isfinite(channel.t)
    return channel.t[good], channel.y[good]


def _held_before(command: Channel, t: FloatArray) -> FloatArray:
    """Return the command that was held just before each instant."""
    index = np.clip(np.searchsorted(command.t, t, side="right") - 1, 0, len(command) - 1)
    return np.nan_to_num(command.y[index])
