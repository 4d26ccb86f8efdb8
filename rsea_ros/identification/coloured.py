"""Whether a channel's residual is noise of its sensor, coloured or not, or a misfit of the model.

Sensor noise is stationary; its spectrum falls with frequency and is flat below what a block of a second
resolves; whitened, it is nearly Gaussian; and it is independent of the command, of the motion, and of
other sensors. A residual that passes all of these tests is noise, however large; one that fails in any point
is a misfit. The limits (noise_settings.py) were set between noise of first order with a memory of up to
0.25 s and mild effects, inside and outside the catalogue, of the second bench in test/independent.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rsea_ros.identification.noise_settings import DEFAULT, NoiseSettings
from rsea_ros.identification.problem import Case
from rsea_ros.identification.spectra import HANN, OVERLAP, TOP, SpectralShape, segment_spectra, shape_of
from rsea_ros.identification.witnesses import witnesses
from rsea_ros.records.record import ComplexArray, FloatArray

_LONG, _SHORT = 1024, 512
_STEADY_BANDS = (0.4, 3.0, 10.0, 40.0)
_SHARED_BANDS = (0.4, 4.0, 14.0, 50.0)
"""Hz, lower ends; the last band ends below the Nyquist frequency."""


def is_noise(
    case: Case,
    outputs: Mapping[str, FloatArray],
    channel: str,
    ratio: float = 1.0,
    rule: NoiseSettings = DEFAULT,
) -> bool:
    """Return whether the residual of a channel is noise of its sensor, coloured or not.

    outputs: of the fitted model, by channel. ratio: of the gear, rotor over output.
    False where the record is too short to decide.
    """
    residual = residual_of(case, outputs, channel)
    if len(residual) < rule.fewest or not np.any(residual):
        return False
    rate = 1.0 / float(np.median(np.diff(case.t[channel])))
    if _lasting_share(residual) > rule.lasting or _slow(residual, rate) > rule.slow:
        return False
    spectra = segment_spectra(residual, _LONG, 8)
    shape = shape_of(spectra)
    if shape.off > rule.shape or _unsteady(spectra, shape, rate) > rule.unsteady:
        return False
    if _kurtosis(shape, residual) > rule.spiky:
        return False
    short_spectra = segment_spectra(residual, _SHORT, 16)
    others = (segment_spectra(w, _SHORT, 16) for w in witnesses(case, outputs, channel, ratio))
    return all(_coherent_share(short_spectra, other, rate) < rule.shared for other in others)


def residual_of(case: Case, outputs: Mapping[str, FloatArray], channel: str) -> FloatArray:
    """Return measured - simulated, 0 where a sample does not count, shape of the channel."""
    return np.where(case.mask[channel], case.measured[channel] - outputs[channel], 0.0)


def _lasting_share(values: FloatArray) -> float:
    """Return the share of the power in a constant and a trend."""
    late = np.linspace(-1.0, 1.0, len(values))
    line = np.polyval(np.polyfit(late, values, 1), late)
    return float(np.mean(line**2) / np.mean(values**2))


def _slow(values: FloatArray, rate: float) -> float:
    """Return the power density below 0.25 Hz over that from 0.3 to 1 Hz; 0 where the record is too short."""
    spectra = segment_spectra(values, 2**30, 2)
    frequency, power = _lines(spectra, rate), np.mean(np.abs(spectra) ** 2, axis=0)
    low = (frequency > 0.0) & (frequency < 0.25)
    above = (frequency >= 0.3) & (frequency < 1.0)
    if np.count_nonzero(low) < 2 or not above.any():
        return 0.0
    return float(power[low].mean() / max(power[above].mean(), 1e-300))


def _unsteady(spectra: ComplexArray, shape: SpectralShape, rate: float) -> float:
    """Return the variance of the whitened power over time, over stationary noise's, in the worst band."""
    power = np.abs(spectra) ** 2 / shape.at(np.linspace(0.0, 1.0, spectra.shape[1]))
    ratios = [0.0]
    for inside in _bands(_lines(spectra, rate), _STEADY_BANDS):
        level = power[:, inside].mean(axis=1)
        expected = HANN / np.count_nonzero(inside)
        ratios.append(float(np.var(level / level.mean())) / expected)
    return max(ratios)


def _kurtosis(shape: SpectralShape, values: FloatArray) -> float:
    """Return the excess kurtosis of whitened values."""
    white = shape.whiten(values)
    white = white - white.mean()
    return float(np.mean(white**4) / np.mean(white**2) ** 2) - 3.0


def _coherent_share(a: ComplexArray, b: ComplexArray, rate: float) -> float:
    """Return the share of the power of a that is coherent with b, without its bias, in the worst band."""
    chance = OVERLAP / len(a)
    powers = np.sum(np.abs(a) ** 2, axis=0) * np.sum(np.abs(b) ** 2, axis=0)
    coherence = np.abs(np.sum(a * b.conj(), axis=0)) ** 2 / np.maximum(powers, 1e-300)
    share = (coherence - chance) / (1.0 - chance)
    return max(float(share[inside].mean()) for inside in _bands(_lines(a, rate), _SHARED_BANDS))


def _lines(spectra: ComplexArray, rate: float) -> FloatArray:
    return np.linspace(0.0, 0.5 * rate, spectra.shape[1])


def _bands(frequency: FloatArray, lows: tuple[float, ...]) -> list[FloatArray]:
    """Return which lines lie in each band that has some."""
    top = TOP * frequency[-1]
    ends = zip(lows, (*lows[1:], np.inf), strict=True)
    inside = [(frequency >= low) & (frequency < min(high, top)) for low, high in ends]
    return [which for which in inside if np.count_nonzero(which) > 1]
