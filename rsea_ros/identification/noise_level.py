"""Noise level of the residuals: white or coloured, from channels that witness each other.

A floor is never above the residual's white part, which no law of the bench can make; and where all of a
residual passes for noise of the sensor it equals that residual. That noise is called coloured
only where it exceeds its white part by more than the doubt of that part, which is large in short records.

Sensor noise is stationary; its spectrum falls with frequency and is flat below what a block of a second
resolves; whitened, it is nearly Gaussian; and it is independent of the command, of the motion, and of
other sensors. A residual that passes all of these tests is noise, however large; one that fails in any point
is a misfit. The limits were set between noise of first order with a memory of up to
0.25 s and mild effects, inside and outside the catalogue, of the second bench in test/independent.

The command; laws of friction, play, springs, ripple and drift over the simulated motion; and the
residual of another sensor: two sensors that see the same misfit agree about it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.effects.signal_table import sensor_of
from rsea_ros.identification import noise as noises
from rsea_ros.identification.problem import Case, counted_span, residual_of
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import ComplexArray, FloatArray, IntArray

_SHARP = 0.05
"""Of a signal's RMS: the width of its sign's step."""


def witnesses(
    case: Case, outputs: Mapping[str, FloatArray], channel: str, ratio: float
) -> Iterator[FloatArray]:
    """Yield signals at the stamps of a channel. outputs: simulated. ratio: of the gear, rotor over output."""
    t = case.t[channel]
    for n in case.measured.keys() & outputs.keys():
        if sensor_of(n) != sensor_of(channel):  # the noise of one encoder's channels agrees
            yield np.interp(t, case.t[n], residual_of(case, outputs, n))
    command, q, v, load = _motion(case, outputs, t)
    late = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)
    yield command
    yield command**3
    for x in (q, v, load):
        yield from (_sign(x), x * np.abs(x), x * late)
    yield from (q**2, q**3, np.abs(v), np.abs(load) * _sign(v))
    yield from (np.sin(ratio * q), np.cos(ratio * q))


def _sign(x: FloatArray) -> FloatArray:
    return np.tanh(x / max(_SHARP * float(np.std(x)), 1e-300))


def _motion(case: Case, outputs: Mapping[str, FloatArray], t: FloatArray) -> tuple[FloatArray, ...]:
    """Return command, position, velocity and load at instants; those without a sensor are derived."""
    drive = case.drive
    if not isinstance(drive, Drive):
        return tuple(np.interp(t, drive.t, y) for y in (drive.torque, drive.q, drive.v, drive.torque))
    command = drive.command_at(t)
    at = {n: np.interp(t, case.t[n], outputs[n]) for n in case.t.keys() & outputs.keys()}
    load = at.get("ft", command)
    q = at.get("position", load)
    v = at["velocity"] if "velocity" in at else np.gradient(q, t)
    return command, q, v, load


_LONG, _SHORT = 1024, 512
_STEADY_BANDS = (0.4, 3.0, 10.0, 40.0)
_SHARED_BANDS = (0.4, 4.0, 14.0, 50.0)
"""Hz, lower ends; the last band ends below the Nyquist frequency."""
_ABOVE, _SURE = 1.04, 4.0
"""RMS of a residual over the noise above which it may be coloured (as floor.only_noise), and standard
deviations of the white part above which it is: chance reaches 4 in one of 30 000 channels."""
_FEWEST = 1500
"""Samples from which coloured noise is looked for: of fewer, noise and misfit look alike."""
_OFF, _UNSTEADY, _SHARED, _SLOW, _LASTING, _SPIKY = 5.0, 4.0, 0.2, 6.0, 0.1, 1.0
"""A residual is noise, however large, below all of these: standard deviations of a band off a falling
spectrum (noise reaches 3.5 in 300 records); variance of the power over time, over that of stationary noise
(2.3); share of a band's power coherent with another signal (chance 0.17, effects 0.9); power density below
0.25 Hz over that from 0.3 to 1 Hz (3); share of a constant and a trend (0.03, a drift has most); excess
kurtosis (0.1, knocks over 10)."""


def is_noise(
    case: Case, outputs: Mapping[str, FloatArray], channel: str, ratio: float = 1.0
) -> bool:
    """Return whether the residual of a channel is noise of its sensor, coloured or not.

    outputs: of the fitted model, by channel. ratio: of the gear, rotor over output.
    False where the record is too short to decide.
    """
    span = counted_span(case.mask[channel])
    residual = residual_of(case, outputs, channel)[span]
    if len(residual) < _FEWEST or not np.any(residual):
        return False
    rate = 1.0 / float(np.median(np.diff(case.t[channel])))
    if _lasting_share(residual) > _LASTING or _slow(residual, rate) > _SLOW:
        return False
    spectra = _as_made(case, channel, noises.unit_spectra(residual, _LONG, 8))
    shape = noises.shape_of(spectra)
    if shape.off > _OFF or _unsteady(spectra, shape, rate) > _UNSTEADY:
        return False
    if _kurtosis(shape, residual) > _SPIKY:
        return False
    short_spectra = noises.unit_spectra(residual, _SHORT, 16)
    others = (noises.unit_spectra(w[span], _SHORT, 16) for w in witnesses(case, outputs, channel, ratio))
    return all(_coherent_share(short_spectra, other, rate) < _SHARED for other in others)


def _as_made(case: Case, channel: str, spectra: ComplexArray) -> ComplexArray:
    """Return spectra of a residual as they were before the known filter of its sensor colours noise."""
    if channel not in case.filters:
        return spectra
    known = case.filters[channel].coefficients(float(np.median(np.diff(case.t[channel]))), held=True)
    b, a = (np.abs(np.fft.rfft(part, 2 * spectra.shape[1] - 2)) ** 2 for part in known)
    passed = np.convolve(np.pad(b / a, 1, mode="reflect"), _HANN_LINES, mode="valid")
    return np.asarray(spectra / np.sqrt(np.maximum(passed, 1e-12)))


_HANN_LINES = np.array([1.0, 4.0, 1.0]) / 6.0
"""Shares of the power of a line, and of its neighbours, behind a Hann window."""


def _lasting_share(values: FloatArray) -> float:
    """Return the share of the power in a constant and a trend."""
    late = np.linspace(-1.0, 1.0, len(values))
    line = np.polyval(np.polyfit(late, values, 1), late)
    return float(np.mean(line**2) / np.mean(values**2))


def _slow(values: FloatArray, rate: float) -> float:
    """Return the power density below 0.25 Hz over that from 0.3 to 1 Hz; 0 where the record is too short."""
    spectra = noises.unit_spectra(values, 2**30, 2)
    frequency, power = _lines(spectra, rate), np.mean(np.abs(spectra) ** 2, axis=0)
    low = (frequency > 0.0) & (frequency < 0.25)
    above = (frequency >= 0.3) & (frequency < 1.0)
    if np.count_nonzero(low) < 2 or not above.any():
        return 0.0
    return float(power[low].mean() / max(power[above].mean(), 1e-300))


def _unsteady(spectra: ComplexArray, shape: noises.SpectralShape, rate: float) -> float:
    """Return the variance of the whitened power over time, over stationary noise's, in the worst band."""
    power = np.abs(spectra) ** 2 / shape.at(np.linspace(0.0, 1.0, spectra.shape[1]))
    ratios = [0.0]
    for inside in _bands(_lines(spectra, rate), _STEADY_BANDS):
        level = power[:, inside].mean(axis=1)
        expected = noises.HANN / np.count_nonzero(inside)
        ratios.append(float(np.var(level / level.mean())) / expected)
    return max(ratios)


def _kurtosis(shape: noises.SpectralShape, values: FloatArray) -> float:
    """Return the excess kurtosis of whitened values."""
    white = shape.whiten(values)
    white = white - white.mean()
    return float(np.mean(white**4) / np.mean(white**2) ** 2) - 3.0


def _coherent_share(a: ComplexArray, b: ComplexArray, rate: float) -> float:
    """Return the share of the power of a that is coherent with b, without its bias, in the worst band."""
    chance = noises.OVERLAP / len(a)
    powers = np.sum(np.abs(a) ** 2, axis=0) * np.sum(np.abs(b) ** 2, axis=0)
    coherence = np.abs(np.sum(a * b.conj(), axis=0)) ** 2 / np.maximum(powers, 1e-300)
    share = (coherence - chance) / (1.0 - chance)
    return max(float(share[inside].mean()) for inside in _bands(_lines(a, rate), _SHARED_BANDS))


def _lines(spectra: ComplexArray, rate: float) -> FloatArray:
    return np.linspace(0.0, 0.5 * rate, spectra.shape[1])


def _bands(frequency: FloatArray, lows: tuple[float, ...]) -> list[FloatArray]:
    """Return which lines lie in each band that has some."""
    top = noises.TOP * frequency[-1]
    ends = zip(lows, (*lows[1:], np.inf), strict=True)
    inside = [(frequency >= low) & (frequency < min(high, top)) for low, high in ends]
    return [which for which in inside if np.count_nonzero(which) > 1]


_WHITE_DOUBT = 1.5
"""Relative standard deviation of the RMS of white noise read off the top of the band, times sqrt(samples).

The median over a share of 0.36 of the lines has 1.25 / sqrt(0.18 n) of its power, half of that of its RMS.
"""
_BLOCK = 1.0
"""s. Coloured noise is independent from one such block to the next."""


def reestimate_noise(case: Case, outputs: Mapping[str, FloatArray], ratio: float = 1.0) -> Case:
    """Return a case with its noise from a fitted model's residual.

    outputs: simulated, by channel. ratio: of the gear, rotor over output, for ripple. Coloured noise is taken
    only where every channel above its white noise passes for noise: a misfit seldom shows in one alone.
    """
    channels = [n for n in case.measured if n in outputs and case.mask[n].any()]
    residuals = {n: residual_of(case, outputs, n) for n in channels}
    rms = {n: float(np.sqrt(np.mean(residuals[n][case.mask[n]] ** 2))) for n in channels}
    noise = dict(case.noise)
    for n in channels:
        span = counted_span(case.mask[n])
        white, is_white = noises.top_of_band(residuals[n][span], _seams(case, n) - span.start)
        white /= float(np.sqrt(np.mean(case.mask[n][span])))  # what does not count in between is zero
        level = white if is_white and isinstance(case.drive, Drive) else rms[n]  # a Motion is filtered
        noise[n] = max(min(noise[n], level), case.least.get(n, 0.0))
    above = [n for n in channels if rms[n] > _ABOVE * noise[n]]
    if not above or not all(is_noise(case, outputs, n, ratio) for n in above):
        return replace(case, noise=noise, coloured=frozenset())
    chance = {n: _SURE * _WHITE_DOUBT / float(np.sqrt(np.count_nonzero(case.mask[n]))) for n in above}
    coloured = frozenset(n for n in above if rms[n] > max(_ABOVE, 1.0 + chance[n]) * noise[n])
    for n in above:
        noise[n] = rms[n] * (1.0 + 2.0 * _doubt(case, residuals[n], n) if n in coloured else 1.0)
    return replace(case, noise=noise, coloured=coloured)


def _seams(case: Case, channel: str) -> IntArray:
    """Return the samples of a channel with which a span of a record begins, but for the first."""
    drive = case.drive
    if not isinstance(drive, Drive):
        return np.empty(0, np.int64)
    return np.searchsorted(case.t[channel], [drive.start + drive.step * end for _, end in drive.spans[:-1]])


def _doubt(case: Case, residual: FloatArray, channel: str) -> float:
    """Return the relative standard deviation of the RMS of a residual, from how it varies over time."""
    keep = case.mask[channel]
    block = np.floor((case.t[channel][keep] - case.start) / _BLOCK).astype(np.int64)
    block -= block.min()
    counts = np.bincount(block)
    power = (np.bincount(block, residual[keep] ** 2) / np.maximum(counts, 1))[counts > 0]
    if len(power) < 2 or power.mean() == 0.0:
        return 0.0
    return float(0.5 * power.std() / power.mean() / np.sqrt(len(power)))
