"""Each measure that separates coloured noise from a misfit, against theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from coloured_cases import RATE, white
from scipy.signal import lfilter

from rsea_ros.identification import noise_level as coloured
from rsea_ros.identification.noise import SpectralShape, shape_of, unit_spectra

ALTERNATING = np.resize([1.0, -1.0], 10_000)


@pytest.mark.parametrize(
    ("values", "share"),
    [
        (np.full(1000, 3.0), 1.0),
        (np.linspace(-2.0, 5.0, 1000), 1.0),
        (ALTERNATING, 0.0),
        (ALTERNATING + 1.0, 0.5),
        (ALTERNATING + 2.0, 0.8),
        (ALTERNATING + np.linspace(-3.0, 3.0, 10_000), 0.75),  # a trend of RMS sqrt(3)
        (np.linspace(-1.0, 1.0, 10_000) ** 2 - 1.0 / 3.0, 0.0),  # a curve is neither
    ],
)
def test_the_share_of_a_constant_and_a_trend_is_measured(values, share):
    assert coloured._lasting_share(values) == pytest.approx(share, abs=2e-3)


def sines(size, *tones, rate=RATE):
    """Sines of given frequency (Hz) and amplitude."""
    t = np.arange(size) / rate
    return sum(a * np.sin(2.0 * math.pi * f * t + 0.3) for f, a in tones)


def shape_noise(size, density, seed=0):
    """Noise of a power density that is a function of frequency (Hz)."""
    spectrum = np.fft.rfft(white(size, seed))
    frequency = np.linspace(0.0, 0.5 * RATE, len(spectrum))
    return np.fft.irfft(spectrum * np.sqrt(density(frequency)), size)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 0.25, 50.0),  # all of what is called slow
        (0.12, 0.25, 50.0 * 0.5),  # half of it
        (0.25, 0.3, 1.0),  # between: neither
        (0.3, 1.0, 1.0 / 50.0),
        (0.3, 0.65, 1.0 / 25.5),  # half of what it is compared with
        (1.0, 99.0, 1.0),
    ],
)
def test_slow_is_below_a_quarter_of_a_hertz(low, high, expected):
    """Power of 50 within a band and of 1 elsewhere, over 256 s."""
    y = shape_noise(2**16, lambda f: np.where((f >= low) & (f < high), 50.0, 1.0))
    assert coloured._slow(y, RATE) == pytest.approx(expected, rel=0.35)


@pytest.mark.parametrize(
    ("line", "ratio"),
    [
        (0, 1.0),  # a mean
        (1, 34.0),  # 100, 1 and 1 on average
        (3, 34.0),
        (4, 1.0),  # 0.25 Hz
        (5, 0.1),  # 0.3125 Hz: 100 and ten times 1
        (15, 0.1),
        (16, 1.0),  # 1 Hz
    ],
)
def test_slow_lines_are_compared_with_those_up_to_a_hertz(monkeypatch, line, ratio):
    """Lines of a sixteenth of a hertz, one of which has a power of 100."""
    spectra = np.ones((2, 129), complex)
    spectra[:, line] = 10.0
    monkeypatch.setattr(coloured, "unit_spectra", lambda *rest: spectra)
    assert coloured._slow(np.zeros(9), 16.0) == pytest.approx(ratio)


@pytest.mark.parametrize(("lines", "ratio"), [(101, 1.0), (81, 0.0)])
def test_at_least_two_slow_lines_are_needed(monkeypatch, lines, ratio):
    """At 20 Hz: lines of 0.1 Hz, and of 0.125."""
    monkeypatch.setattr(coloured, "unit_spectra", lambda *rest: np.ones((2, lines), complex))
    assert coloured._slow(np.zeros(9), 20.0) == ratio


def test_a_mean_is_not_slow():
    y = white(2**15)
    assert coloured._slow(y + 1e3, RATE) == pytest.approx(coloured._slow(y, RATE), rel=1e-6)


@pytest.mark.parametrize(("seconds", "known"), [(14, False), (33, True)])
def test_a_record_without_two_slow_lines_leaves_slowness_open(seconds, known):
    """Segments of half its length: of 8 s one line lies below 0.25 Hz, of 16 s three."""
    y = white(int(seconds * RATE)) + sines(int(seconds * RATE), (0.12, 9.0))
    assert (coloured._slow(y, RATE) > 0.0) is known


def test_values_too_rare_for_a_hertz_are_not_slow():
    assert coloured._slow(white(64), 1e9) == 0.0


@pytest.mark.parametrize(
    ("values", "excess"),
    [
        (lambda rng: rng.normal(size=50_000), 0.0),
        (lambda rng: rng.uniform(-1.0, 1.0, 50_000), -1.2),
        (lambda rng: rng.laplace(size=50_000), 3.0),
        (lambda rng: 5.0 + 2.0 * rng.uniform(-1.0, 1.0, 50_000), -1.2),  # whatever mean and size
    ],
)
def test_the_excess_kurtosis_of_known_distributions_is_right(values, excess):
    flat = SpectralShape(np.array([0.1, 1.0]), np.array([1.0, 1.0]), 0.0)
    assert coloured._kurtosis(flat, values(np.random.default_rng(1))) == pytest.approx(excess, abs=0.15)


def test_kurtosis_is_that_of_the_whitened_residual():
    """Smoothing makes anything Gaussian; what was smoothed is not."""
    y = lfilter([1.0], [1.0, -0.97], np.random.default_rng(2).laplace(size=2**16))
    shape = shape_of(unit_spectra(y, 1024, 8))
    flat = SpectralShape(np.array([0.1, 1.0]), np.array([1.0, 1.0]), 0.0)
    assert coloured._kurtosis(flat, y) < 0.3
    assert coloured._kurtosis(shape, y) > 0.7


def unsteady(y, shape=None):
    spectra = unit_spectra(y, 1024, 8)
    return coloured._unsteady(spectra, shape or shape_of(spectra), RATE)


@pytest.mark.parametrize("memory", [0.0, 0.95])
def test_power_of_stationary_noise_varies_as_it_should(memory):
    worst = [unsteady(lfilter([1.0], [1.0, -memory], white(2**16, seed=k))) for k in range(8)]
    assert 0.8 < np.mean(worst) < 1.6


@pytest.mark.parametrize(("band", "least"), [((0.6, 3.0), 1.4), ((3.0, 10.0), 5.0), ((10.0, 40.0), 20.0)])
def test_noise_that_comes_late_in_one_band_is_unsteady(band, least):
    """The power of a band of n lines is off by its mean half of the time: n / 1.5 times what it may be."""
    size = 2**16
    burst = shape_noise(size, lambda f: np.where((f >= band[0]) & (f < band[1]), 40.0, 0.0), seed=5)
    burst[: size // 2] = 0.0
    lines = (band[1] - band[0]) * 1024 / RATE
    value = unsteady(white(size) + burst)
    assert value == pytest.approx(lines / 1.5, rel=0.35) and value > least


def test_the_worst_band_decides_whether_noise_is_steady():
    calm = np.ones((10, 513), complex)
    flat = SpectralShape(np.array([0.001, 1.0]), np.array([1.0, 1.0]), 0.0)
    assert coloured._unsteady(calm, flat, RATE) == 0.0
    burst = calm.copy()
    burst[:5, 40:160] *= math.sqrt(3.0)  # from 10 to 40 Hz: 3 and 1, off by half of its mean
    assert coloured._unsteady(burst, flat, RATE) == pytest.approx(0.25 * 120 / 1.5)
    assert coloured._unsteady(burst, SpectralShape(flat.share, 9.0 * flat.level, 0.0), RATE) == pytest.approx(
        20.0
    )


def share(a, b):
    return coloured._coherent_share(unit_spectra(a, 512, 16), unit_spectra(b, 512, 16), RATE)


@pytest.mark.parametrize(
    ("gain", "expected"),
    [(0.0, 0.0), (0.5, 0.2), (1.0, 0.5), (2.0, 0.8), (-1.0, 0.5), (1e6, 1.0)],
)
def test_the_coherent_share_of_the_power_is_measured(gain, expected):
    witness = white(2**15, seed=1)
    assert share(white(2**15) + gain * witness, witness) == pytest.approx(expected, abs=0.04)
    assert share(white(2**15) + gain * witness, 1e3 * witness) == pytest.approx(expected, abs=0.04)


def test_coherence_is_corrected_for_chance():
    """Of 16 segments, 31 half overlapping, one in 29 of the power agrees by chance, in no band more."""
    one_band = [share(white(8192, seed=k), white(8192, seed=1000 + k)) for k in range(40)]
    assert -0.01 < np.mean(one_band) < 0.05  # the worst of four bands


def test_the_worst_band_decides_what_is_shared():
    witness = white(2**16, seed=1)
    low = shape_noise(2**16, lambda f: np.where(f < 4.0, 1.0, 0.0), seed=1)
    assert share(white(2**16) + 3.0 * low, witness) == pytest.approx(0.9, abs=0.03)


NOT_SHARED = -(1.056 / 4) / (1.0 - 1.056 / 4)
"""Of four segments: what no coherence at all comes to, less what chance makes of it."""


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        # lines of half a hertz: 1 to 7 below 4 Hz, 8 to 27 below 14, 28 to 99 below 50, 100 to 245 above
        (1, 7, 1.0),
        (1, 1, (1.0 + 6.0 * NOT_SHARED) / 7.0),
        (8, 27, 1.0),
        (28, 99, 1.0),
        (100, 245, 1.0),
        (0, 0, NOT_SHARED),
        (246, 256, NOT_SHARED),
    ],
)
def test_lines_that_are_shared_count_in_their_band(first, last, expected):
    a, b = np.ones((4, 257), complex), np.ones((4, 257), complex)
    b[2:] = -1.0
    b[2:, first : last + 1] = 1.0
    assert coloured._coherent_share(a, b, RATE) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("first", "last", "lines"), [(2, 11, 10), (12, 39, 28), (40, 159, 120), (160, 491, 332), (0, 1, 0)]
)
def test_lines_that_are_unsteady_count_in_their_band(first, last, lines):
    """Lines of a quarter of a hertz, with powers of 3 and 1: off by half of the mean."""
    spectra = np.ones((10, 513), complex)
    spectra[:5, first : last + 1] = math.sqrt(3.0)
    flat = SpectralShape(np.array([0.001, 1.0]), np.array([1.0, 1.0]), 0.0)
    assert coloured._unsteady(spectra, flat, RATE) == pytest.approx(0.25 * lines / 1.5)


def test_without_power_nothing_is_shared():
    assert share(np.zeros(8192), white(8192)) == pytest.approx(-1.056 / 31 / (1.0 - 1.056 / 31))


def test_lines_lie_between_zero_and_half_the_rate():
    assert coloured._lines(np.zeros((3, 5)), 8.0).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("top", "lows", "inside"),
    [
        (10, (0.4, 3.0, 7.0), [[1, 2], [3, 4, 5, 6], [7, 8, 9]]),  # the last ends at 9.6
        (10, (3.0, 9.0), [[3, 4, 5, 6, 7, 8]]),  # a band of one line has none
        (10, (3.0, 20.0), [[3, 4, 5, 6, 7, 8, 9]]),
        (10, (7.0, 8.0), [[8, 9]]),
        (200, (188.5, 195.0), [[189, 190, 191]]),
    ],
)
def test_every_band_has_its_lines(top, lows, inside):
    bands = coloured._bands(np.arange(top + 1.0), lows)
    assert [np.flatnonzero(b).tolist() for b in bands] == inside
