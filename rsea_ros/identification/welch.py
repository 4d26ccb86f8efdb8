"""Frequency response by Welch's method, and above half the rate by unfolding.

G = sum Y_k U_k* / sum |U_k|^2,   var G = s2 (sum |U_k|^2 + 2 rho Re sum U_k U_{k+1}*) / (sum |U_k|^2)^2

s2 is the residual power of a segment and rho = 1/6 the correlation of noise between Hann segments that
overlap by half. (Welch, IEEE Trans. Audio Electroacoust. 15, 1967; Bendat, Piersol, Random Data, 4th ed., 9.)

A command held over T and samples taken d periods after its steps see, with x in cycles a period and
s_k = 2 pi i (x + k) / T,

    measured(x) = sum_k G(s_k) h(x + k) e^{2 pi i (x + k) d},   h(x) = sinc(x) e^{-i pi x}

k = 0 is wanted; the other images are folded into the band: at 0.36 of the sample rate they are 17 % of a
second-order response. Above the band every finite actuator is a short series in 1/s, late by a delay,

    G(s) ~ e^{-s tau} (m_1 / s + m_2 / s^2 + m_3 / s^3 + m_4 / s^4)

whose real Markov parameters m are fitted to the upper part of the band; the sampled 1/s^p is
known in closed form (sampled_integrators).
(Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed., section 4.3; Kailath, Linear Systems, 2.4.)
"""

from __future__ import annotations

import numpy as np
from numpy.fft import rfft
from numpy.polynomial.polynomial import polyval

from rsea_ros.identification.local_polynomial import Aligned, Lines, detrend, widen
from rsea_ros.records.record import ComplexArray, FloatArray, IntArray
from rsea_ros.records.spectra import next_fast_length

LONGEST_SEGMENT = 16.0
"""s. Long against what the actuator remembers, so that segments leak little."""
FEWEST_SEGMENTS = 12
_SHORTEST_SEGMENT = 4.0
_FIRST_LINE = 2
_ALIKE = 0.25
"""Random segments come to 0.5 in the middle and 0.3 at the 5 % quantile that is asked."""
_OVERLAP_CORRELATION = 1.0 / 6.0
_TINY = 1e-300


def suits(aligned: Aligned) -> bool:
    """Return whether a record is long enough for this method, and its command alike in all segments.

    A sweep has its low frequencies in few segments: (sum |U|^2)^2 / sum |U|^4 counts them.
    """
    length = _length(aligned)
    starts = _starts(aligned, length)
    if length * aligned.period < _SHORTEST_SEGMENT or len(starts) < FEWEST_SEGMENTS:
        return False
    power = np.abs(_segments(aligned.command, starts, length)[:, _FIRST_LINE:]) ** 2
    bearing = np.sum(power, axis=0) ** 2 / (np.sum(power**2, axis=0) + _TINY)
    return float(np.quantile(bearing, 0.05)) > _ALIKE * len(starts)


def welch(aligned: Aligned) -> Lines:
    """Return the response by averaging over the segments that have no gap."""
    length = _length(aligned)
    starts = _starts(aligned, length)
    u, y = (_segments(x, starts, length) for x in (aligned.command, aligned.output))
    s_uu = np.sum(np.abs(u) ** 2, axis=0) + _TINY
    response = np.sum(y * u.conj(), axis=0) / s_uu
    effective = len(starts) / (1.0 + 2.0 * _OVERLAP_CORRELATION**2)
    residual = np.sum(np.abs(y - response * u) ** 2, axis=0) / len(starts) * effective / (effective - 1.0)
    next_to = (starts[1:] - starts[:-1] == length // 2)[:, None]
    overlap = np.sum(next_to * _align_phases(u[1:] * u[:-1].conj(), length).real, axis=0)
    spread = np.sqrt(residual * np.maximum(s_uu + 2.0 * _OVERLAP_CORRELATION * overlap, 0.5 * s_uu)) / s_uu
    s_yy = np.sum(np.abs(y) ** 2, axis=0) + _TINY
    keep = slice(_FIRST_LINE, None)
    return Lines(
        method="Welch",
        frequency=(np.arange(u.shape[1]) / (length * aligned.period))[keep],
        response=response[keep],
        sd=widen(spread, effective - 1.0)[keep],
        coherence=np.minimum(np.abs(response) ** 2 * s_uu / s_yy, 1.0)[keep],
        noise=(np.sqrt(2.0 * residual / np.sum(_window(length) ** 2) / length))[keep],
    )


def _length(aligned: Aligned) -> int:
    """Return the segment length in samples, even."""
    duration = len(aligned.command) * aligned.period
    seconds = min(LONGEST_SEGMENT, duration / (FEWEST_SEGMENTS / 2.0 + 1.0))
    return 2 * int(next_fast_length(int(seconds / aligned.period / 2.0), real=True))


def _starts(aligned: Aligned, length: int) -> IntArray:
    starts = np.arange(0, len(aligned.command) - length + 1, length // 2)
    missing = np.concatenate([[0], np.cumsum(~aligned.measured)])
    whole: IntArray = starts[missing[starts + length] == missing[starts]]
    return whole


def _segments(values: FloatArray, starts: IntArray, length: int) -> ComplexArray:
    """Return the windowed spectra, shape (segments, lines)."""
    windows = np.lib.stride_tricks.sliding_window_view(detrend(values), length)[starts]
    spectra: ComplexArray = rfft(windows * _window(length), axis=1)
    return spectra


def _window(length: int) -> FloatArray:
    window: FloatArray = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    return window


def _align_phases(cross: ComplexArray, length: int) -> ComplexArray:
    """Refer the product of neighbouring spectra to one time: half a segment is a turn of pi a line."""
    turned: ComplexArray = cross * (-1.0) ** np.arange(cross.shape[1])
    return turned


_ORDERS = np.arange(1, 5)
_FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0, 24.0])
_EULERIAN = ((1.0,), (0.0, 1.0), (0.0, 1.0, 1.0), (0.0, 1.0, 4.0, 1.0), (0.0, 1.0, 11.0, 11.0, 1.0))
"""sum_n n^j w^n = (these coefficients in w) / (1 - w)^(j + 1)."""
_FITTED_BAND = (0.18, 0.42)
"""Cycles a period: where the series is fitted."""
_FITTED_LINES = 80
_DELAYS = np.arange(0.0, 3.01, 0.125)
"""Delays that are tried, in periods."""
_NO_DELAY_WITHIN = 1.2


def unfold(
    aligned: Aligned, frequency: FloatArray, measured: ComplexArray, sd: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Return the continuous-time response and its sd. frequency: Hz; measured: output per held command."""
    x = frequency * aligned.period
    at_steps = measured * np.exp(-2j * np.pi * frequency * aligned.delay)
    if aligned.held:
        return at_steps, sd
    response: ComplexArray = (at_steps - _fold(x, at_steps, sd, aligned.offsets)) / _hold(x)
    return response, sd / np.abs(_hold(x))


def sampled_integrators(x: FloatArray, offset: float) -> ComplexArray:
    """Return 1/s^p after hold and sampling, p = 1 … 4, per period^p, shape (4, n).

    e^{-2 pi i x d} (1 - w) sum_{n + d > 0} (n + d)^p / p! w^n,   w = e^{-2 pi i x}
    """
    whole, rest = divmod(offset, 1.0)
    w = np.exp(-2j * np.pi * x)
    sums = np.array([polyval(w, c) / (1.0 - w) ** (j + 1) for j, c in enumerate(_EULERIAN)])
    terms = [_shifted_power(sums, int(p), rest) / _FACTORIALS[p] for p in _ORDERS]
    sampled: ComplexArray = np.array(terms) * (1.0 - w) * w ** (-whole) * np.exp(-2j * np.pi * x * offset)
    return sampled


def _shifted_power(sums: ComplexArray, p: int, d: float) -> ComplexArray:
    """Return sum_n (n + d)^p w^n from sum_n n^j w^n, by the binomial theorem."""
    factors = [_FACTORIALS[p] / (_FACTORIALS[j] * _FACTORIALS[p - j]) * d ** (p - j) for j in range(p + 1)]
    total: ComplexArray = np.tensordot(factors, sums[: p + 1], axes=1)
    return total


def _fold(x: FloatArray, measured: ComplexArray, sd: FloatArray, offsets: FloatArray) -> ComplexArray:
    """Return the sum of all images but the wanted one."""
    lines = np.flatnonzero((x > _FITTED_BAND[0]) & (x < _FITTED_BAND[1]) & (sd > 0.0))
    if len(lines) < 2 * len(_ORDERS):
        return np.zeros(len(x), complex)
    lines = lines[:: max(1, len(lines) // _FITTED_LINES)]
    delay, markov = _fit(x[lines], measured[lines], sd[lines], offsets)
    wanted = _hold(x) / (2j * np.pi * x) ** _ORDERS[:, None] * np.exp(-2j * np.pi * x * delay)
    folded: ComplexArray = markov @ (_basis(x, offsets, delay) - wanted)
    return folded


def _fit(
    x: FloatArray, measured: ComplexArray, sd: FloatArray, offsets: FloatArray
) -> tuple[float, FloatArray]:
    """Return the delay in periods, and the Markov parameters that fit best with it."""
    fits = []
    for delay in _DELAYS:
        rows, wanted = _real(_basis(x, offsets, delay) / sd).T, _real(measured / sd)
        size = np.linalg.norm(rows, axis=0)
        markov = np.linalg.lstsq(rows / size, wanted, rcond=1e-9)[0] / size
        fits.append((float(np.sum((rows @ markov - wanted) ** 2)), float(delay), markov))
    best = min(fits, key=lambda fit: fit[0])
    chosen = fits[0] if fits[0][0] <= _NO_DELAY_WITHIN * best[0] else best
    return chosen[1], chosen[2]


def _basis(x: FloatArray, offsets: FloatArray, delay: float) -> ComplexArray:
    """Return the sampled integrators, late by `delay` periods, averaged over the offsets of the samples."""
    sampled = [sampled_integrators(x, float(d) - delay) for d in offsets]
    basis: ComplexArray = np.mean(sampled, axis=0) * np.exp(-2j * np.pi * x * delay)
    return basis


def _hold(x: FloatArray) -> ComplexArray:
    hold: ComplexArray = np.sinc(x) * np.exp(-1j * np.pi * x)
    return hold


def _real(values: ComplexArray) -> FloatArray:
    return np.concatenate([values.real, values.imag], axis=-1)
