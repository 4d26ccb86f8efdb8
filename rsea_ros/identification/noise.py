"""Noise of a measured channel: its level, its colour, its smallest step.

At the top of the band of a torque-driven actuator only white sensor noise remains once the linear response to
the command is removed: S_nn = (1 - coherence) S_yy, median over the top of the band. Where
that is not flat (a smoothed log) or the channel is slower than the command, so that the command's upper half
is folded over it, the record does not show its noise; the rig's statement counts until a fit has its
residual; so it does where the command follows the channel (Granger, Econometrica 37, 1969), as in a loop, and
holds its noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import BoolArray, Channel, ComplexArray, FloatArray, IntArray, Record
from rsea_ros.records.statistics import hann, segment_spectra

FEW = 0.2
"""Share of the samples: with more different values than that, a channel has no steps worth the name."""
_ON_GRID = 1e-3
"""Of a step: so near to whole numbers of steps all values must lie."""


def step_of(values: FloatArray) -> float:
    """Return the step of which all finite values are multiples, in their unit; 0 for none."""
    different = np.unique(values[np.isfinite(values)])
    if not 3 <= len(different) < FEW * len(values):
        return 0.0
    step = float(np.median(np.diff(different)))
    places = (different - different[0]) / step
    return step if np.max(np.abs(places - np.round(places))) <= _ON_GRID else 0.0


OVERLAP = 1.056
"""Segments that overlap by half, over as many independent ones (Welch, IEEE Trans. AU-15, 1967)."""
HANN = 1.5
"""Lines that share what one independent line would have, behind a Hann window."""
_BANDS = 20
TOP = 0.96
"""Of the Nyquist frequency: the highest line of all bands."""


def unit_spectra(values: FloatArray, longest: int, fewest: int) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments without their means, shape (segments, lines).

    longest: samples in a segment, a power of two. fewest: number of segments that fit side by side.
    Scaled so that white noise has the square of its RMS in every line.
    """
    length = min(longest, 2 ** math.floor(math.log2(max(len(values), 8 * fewest) / fewest)))
    window = hann(length)
    return np.asarray(segment_spectra(values, length) / math.sqrt(float(window @ window)))


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
        return np.asarray(np.exp(np.interp(np.log(least), np.log(self.share), np.log(self.level))))

    def whiten(self, values: FloatArray) -> FloatArray:
        """Return values divided by the shape's amplitude at every frequency."""
        spectrum = rfft(values)
        gain = 1.0 / np.sqrt(self.at(np.linspace(0.0, 1.0, len(spectrum))))
        return irfft(spectrum * gain, len(values))


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


_TINY = 1e-300
_LONGEST, _SEGMENTS = 512, 8
_FEWEST = 64
_MISSING = 1.5
"""Periods between two samples: with more, one is missing."""
_ROUNDING = 1e-9
"""Of a channel's standard deviation: less than this is rounding, not noise."""
_TOP = (0.62, 0.98)
"""Of half the rate, between which noise is read off: what follows the command is taken away, and a
torque-driven actuator hardly moves there."""
_FLAT = 2.0
"""Ratio of the powers of the two halves of that band up to which it is flat: a filter of second order makes
2.5."""
_SLOWER = 0.9
"""Of the command's rate: of a slower channel the rig's statement counts, the command's upper half is folded
over the band."""
_FILTERED = 0.1
"""Of the noise that a rig states, the least that is believed: less is a filter's work, not a better
sensor's."""
_HIDDEN = 0.8
"""Of the RMS at the top of the band: what is left there without what the command shares hides some."""
_LAGS, _ROWS = 16, 16384
"""Samples before and behind that foretell one, and samples that are foretold at most."""
_FED_BACK = 0.4
"""Of what is new in a sample, the share that later commands tell: an open loop has 0.04 at most, a log
resampled between samples 0.2, a loop that hides the noise of its sensor 0.6 to 1."""


def noise_floor(record: Record, name: str, sensor: Sensor) -> float:
    """Return the RMS of a channel's noise, in its unit: white noise with the level at the top of the band.

    sensor: as the rig states it; its statement counts where the record does not show the noise.
    """
    channel = record[name]
    t, y = (values[np.isfinite(channel.y) & np.isfinite(channel.t)] for values in (channel.t, channel.y))
    least = least_noise(y, sensor)
    stated = sensor.level
    if len(y) < _FEWEST:
        return max(float(np.std(np.diff(y, 2))) / math.sqrt(6.0) if len(y) > 3 else 0.0, stated, least)
    if stated > 0.0 and record[name].rate < _SLOWER * record["command"].rate:
        return max(stated, least)
    command, is_made = record["command"], name == "motor_torque"  # by the drive, of its command
    both, unlike = _powers(command, t, y)
    whole, level = (math.sqrt(float(np.median(power[_top(power)]))) for power in (both, unlike))
    if level < min(stated, _HIDDEN * whole) and not is_made and _is_followed(command, t, y):
        level = min(stated, whole)
    return max(level, least) if _is_flat(unlike) else max(level, stated, least)


def least_noise(values: FloatArray, sensor: Sensor) -> float:
    """Return the least noise of a channel: no model has to fit better.

    Half the rig's quantum, or where the values come in steps larger than that, q / sqrt(12) of those; and a
    tenth of the noise that the rig states: a smaller one comes from a filter that it does not state.
    """
    step = step_of(values)
    coarse = step / math.sqrt(12.0) if step > sensor.quantum else 0.0
    stated = max(0.5 * sensor.quantum, 0.0 if sensor.filter else _FILTERED * sensor.noise)
    return max(stated, coarse, _ROUNDING * float(np.std(values)), _TINY)


def top_of_band(values: FloatArray, seams: Sequence[int] | IntArray = ()) -> tuple[float, bool]:
    """Return the RMS of white noise as high as the top of the band of values, and whether that is flat.

    seams: samples before which values are missing. A jump there would pass for noise.
    """
    spectra = unit_spectra(values, _LONGEST, _SEGMENTS)
    whole = _seamless(spectra, seams)
    power = np.mean(np.abs(spectra[whole if whole.any() else slice(None)]) ** 2, axis=0)
    return math.sqrt(float(np.median(power[_top(power)]))), _is_flat(power)


def _seamless(spectra: ComplexArray, seams: Sequence[int] | IntArray) -> BoolArray:
    """Return which of half-overlapping segments have no seam inside."""
    half = spectra.shape[1] - 1
    first = half * np.arange(len(spectra))
    return np.asarray(np.searchsorted(seams, first, "right") == np.searchsorted(seams, first + 2 * half))


def _powers(command: Channel, t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the power of a channel by frequency, and what of it does not follow the command linearly.

    From segments in which no sample is missing, shorter ones where it takes that, else from all.
    """
    steps = np.diff(t)
    period = float(np.median(steps))
    held = np.nan_to_num(command.held(t - 0.25 * period))
    seams = 1 + np.flatnonzero(steps > _MISSING * period)
    for longest in (_LONGEST, _LONGEST // 4, _LONGEST // 16):
        u, v = (unit_spectra(values, longest, _SEGMENTS) for values in (held, y))
        whole = _seamless(v, seams)
        if np.count_nonzero(whole) >= _SEGMENTS:
            u, v = u[whole], v[whole]
            break
    else:
        u, v = (unit_spectra(values, _LONGEST, _SEGMENTS) for values in (held, y))
    power = np.mean(np.abs(v) ** 2, axis=0)
    shared = np.abs(np.mean(v * u.conj(), axis=0)) ** 2 / (np.mean(np.abs(u) ** 2, axis=0) + _TINY)
    return power, np.asarray(np.maximum(power - shared, 0.0) / (1.0 - 1.8 / max(2.0, len(v))))


def _is_followed(command: Channel, t: FloatArray, y: FloatArray) -> bool:
    """Return whether later commands tell what is new in the samples of a channel.

    New is what neither the samples before nor the commands until then foretell.
    """
    period = float(np.median(np.diff(t)))
    held, next_held = (np.nan_to_num(command.held(t + late * period)) for late in (-0.25, 0.75))
    n = np.arange(_LAGS, len(y) - _LAGS)
    n = n[t[n + _LAGS] - t[n - _LAGS] < (2.0 * _LAGS + 0.5) * period][:_ROWS]
    if len(n) < 64 * _LAGS:
        return False
    y, held, next_held = (v - v.mean() for v in (y, held, next_held))
    lags = np.arange(_LAGS)
    earlier = np.hstack([y[n[:, None] - 1 - lags], held[n[:, None] - lags]])
    new, left = (
        float(np.sum((y[n] - x @ np.linalg.lstsq(x, y[n], rcond=None)[0]) ** 2))
        for x in (earlier, np.hstack([earlier, next_held[n[:, None] + lags]]))
    )
    return left < (1.0 - _FED_BACK) * new


def _is_flat(power: FloatArray) -> bool:
    """Return whether both halves of the top of the band have about the same power; one line is not enough."""
    top = power[_top(power)]
    if len(top) < 2:
        return False
    lower, upper = (float(np.median(half)) for half in np.array_split(top, 2))
    return max(lower, upper) <= _FLAT * max(min(lower, upper), _TINY)


def _top(lines: FloatArray) -> slice:
    """Return where the top of the band lies: one line at least."""
    first, last = math.ceil(_TOP[0] * len(lines)), math.floor(_TOP[1] * len(lines))
    return slice(first, max(last, first + 1))
