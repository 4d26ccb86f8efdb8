"""Quantiles of the normal distribution, runs and integrals of samples, spectra by Welch's method.

Source: Welch, IEEE Trans. Audio Electroacoust. 15, 1967. The same as scipy.signal.welch and csd, whose import
takes longer than a diagnosis that finds nothing wrong. scipy.fft has the lengths, but imports for 0.15 s at
every start; numpy.fft transforms alike.
"""

from functools import lru_cache

import numpy as np

from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray, IntArray

Z95 = 1.959964
"""Standard deviations from the middle of a 95 % interval to its end."""
Z90 = 1.6449
"""The same of a 90 % interval."""
MAD_TO_SD = 1.4826
"""Standard deviation of normal values over their median absolute deviation."""


def runs_of(marked: BoolArray) -> IntArray:
    """Return first and end (exclusive) of each run of marked samples, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return np.asarray(edges.reshape(-1, 2), np.int64)


def running_integral(values: FloatArray, t: FloatArray) -> FloatArray:
    """Return the integral of values from the first time, s, to each, by the trapezoidal rule, shape of t."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])


def segment_spectra(values: FloatArray, length: int) -> ComplexArray:
    """Return the spectrum of each segment of `length` samples, shape (..., segments, length // 2 + 1).

    values: shape (..., n).
    """
    values, hop = np.ascontiguousarray(values), length - length // 2
    shape = (*values.shape[:-1], 1 + (values.shape[-1] - length) // hop, length)
    strides = (*values.strides[:-1], hop * values.itemsize, values.itemsize)
    parts: FloatArray = np.ndarray(shape, values.dtype, values, strides=strides)
    return np.asarray(np.fft.rfft((parts - parts.mean(axis=-1, keepdims=True)) * hann(length), axis=-1))


def power_density(values: FloatArray, rate: float, length: int) -> tuple[FloatArray, FloatArray]:
    """Return frequency, Hz, and one-sided power density, the square of the unit per Hz.

    rate: Hz. length: samples of a segment; that of all values gives the periodogram.
    """
    frequency, density = cross_density(values, values, rate, length)
    return frequency, density.real


def cross_density(
    a: FloatArray, b: FloatArray, rate: float, length: int
) -> tuple[FloatArray, ComplexArray]:
    """Return frequency, Hz, and one-sided cross power density of b with a, product of the units per Hz."""
    product = segment_spectra(a, length).conj() * segment_spectra(b, length)
    one_sided = np.full(product.shape[1], 2.0)
    one_sided[0] = 1.0
    if length % 2 == 0:
        one_sided[-1] = 1.0
    density = one_sided * product.mean(axis=0) / (rate * np.sum(hann(length) ** 2))
    return np.asarray(np.fft.rfftfreq(length, 1.0 / rate), np.float64), density


def stamped_density(
    t: FloatArray, values: FloatArray, longest: int
) -> tuple[float, FloatArray, FloatArray]:
    """Return rate, Hz, frequency, Hz, and power density as above of values at stamps t, s, which rise.

    longest: samples of a segment, at the most. Stamps within a step of an even clock lie on it; others decide
    where on one of their median interval a value lies, as after lost samples or in a log of events. A pause
    counts as one segment.
    """
    steps, filled = np.diff(t), 1.0
    rate = 1.0 / float(np.mean(steps))
    if np.abs((t - t[0]) * rate - np.arange(len(t))).max() > 1.0:
        rate = 1.0 / float(np.median(steps))
        t = np.concatenate([[0.0], np.cumsum(np.minimum(steps, longest / rate))])
        values = on_even_clock(t, values, rate)
        filled = float(np.mean(on_even_clock(t, np.ones(len(t)), rate)))
    frequency, density = power_density(values, rate, min(longest, len(values)))
    return rate, frequency, density / filled


def on_even_clock(t: FloatArray, values: FloatArray, rate: float) -> FloatArray:
    """Return values at a rate (Hz) from the first stamp to the last, zero where none is near."""
    place = np.rint((t - t[0]) * rate).astype(np.int64)
    even = np.zeros(place[-1] + 1)
    even[place] = values
    return even


@lru_cache(maxsize=64)
def hann(length: int) -> FloatArray:
    """Return the periodic Hann window, shape (length,), for all callers: not to be written to."""
    window = np.hanning(length + 1)[:-1]
    window.flags.writeable = False
    return window


_COMPLEX, _REAL = (2, 3, 5, 7, 11), (2, 3, 5)


@lru_cache(maxsize=64)
def next_fast_length(least: int, *, real: bool = False) -> int:
    """Return the least fast length that is not below `least`, 1 or more. real: of a real signal."""
    length = max(1, least)
    while not _is_product_of(length, _REAL if real else _COMPLEX):
        length += 1
    return length


def _is_product_of(number: int, primes: tuple[int, ...]) -> bool:
    for prime in primes:
        while number % prime == 0:
            number //= prime
    return number == 1
