"""Noise or misfit, as tables: each measure against theory, and the decision at each of its limits."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from coloured_cases import RATE, case, white
from scipy.signal import lfilter

from rsea_ros.identification import noise_level as coloured
from rsea_ros.identification.noise import SpectralShape, shape_of, unit_spectra
from rsea_ros.identification.noise_level import is_noise


def passes(y, **more):
    return is_noise(case(y, **more), {"ft": np.zeros(len(y))}, "ft")


FINE = {"_lasting_share": 0.0, "_slow": 0.0, "off": 0.0, "_unsteady": 0.0, "_kurtosis": 0.0, "_shared": 0.0}


@pytest.fixture
def measured(monkeypatch):
    """Make every measure of a residual return a given number."""

    def set_to(**values):
        numbers = {**FINE, **values}
        for name in set(numbers) - {"off", "_shared"}:
            monkeypatch.setattr(coloured, name, lambda *rest, value=numbers[name]: value)
        monkeypatch.setattr(coloured, "shape_of", lambda spectra: SimpleNamespace(off=numbers["off"]))
        shares = iter(np.atleast_1d(numbers["_shared"]))
        monkeypatch.setattr(coloured, "_coherent_share", lambda *rest: next(shares))
        count = len(np.atleast_1d(numbers["_shared"]))
        monkeypatch.setattr(coloured, "witnesses", lambda *rest: [white(2000)] * count)

    return set_to


@pytest.mark.parametrize(
    ("values", "noise"),
    [
        ({}, True),
        ({"_lasting_share": 0.1}, True),
        ({"_lasting_share": 0.11}, False),
        ({"_slow": 6.0}, True),
        ({"_slow": 6.1}, False),
        ({"off": 5.0}, True),
        ({"off": 5.1}, False),
        ({"_unsteady": 4.0}, True),
        ({"_unsteady": 4.1}, False),
        ({"_kurtosis": 1.0}, True),
        ({"_kurtosis": 1.1}, False),
        ({"_kurtosis": -1.2}, True),  # flatter than Gaussian
        ({"_shared": [0.19, 0.19]}, True),
        ({"_shared": [0.0, 0.2]}, False),
        ({"_shared": [0.2, 0.0]}, False),
    ],
)
def test_a_residual_that_fails_in_one_point_is_a_misfit(measured, values, noise):
    measured(**values)
    assert passes(white(2000)) is noise


@pytest.mark.parametrize(("size", "noise"), [(1499, False), (1500, True)])
def test_short_records_decide_nothing(measured, size, noise):
    measured()
    assert passes(white(size)) is noise


@pytest.mark.parametrize(("more", "ratio"), [({}, 1.0), ({"ratio": 502.0}, 502.0)])
def test_measures_are_given_the_rate_of_the_channel_and_the_ratio_of_the_gear(
    measured, monkeypatch, more, ratio
):
    measured()
    seen = []
    monkeypatch.setattr(coloured, "_slow", lambda values, rate: seen.append(rate) or 0.0)
    monkeypatch.setattr(coloured, "witnesses", lambda case, outputs, n, ratio: seen.append(ratio) or [])
    y = white(2000)
    assert is_noise(case(y, rate=100.0), {"ft": np.zeros(2000)}, "ft", **more)
    assert seen == pytest.approx([100.0, ratio])


def test_an_empty_residual_is_not_noise(measured):
    measured()
    assert passes(np.zeros(2000)) is False
    assert passes(np.where(np.arange(2000) % 2, 0.0, white(2000))) is True, "some zeros are"


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.97])
@pytest.mark.parametrize("rate", [100.0, 256.0, 1000.0])
def test_noise_of_first_order_passes(memory, rate):
    y = lfilter([1.0], [1.0, -memory], white(9000, seed=3))[1000:]
    assert passes(y, rate=rate)


T = np.arange(8192) / RATE


@pytest.mark.parametrize(
    "misfit",
    [
        0.5 * np.ones(8192),  # an offset
        np.linspace(-1.0, 1.0, 8192),  # a drift
        np.sin(2 * math.pi * 40.0 * T),  # a line
        np.where(np.arange(8192) % 512 == 0, 20.0, 0.0),  # knocks
        np.where(T > 16.0, 2.0, 0.0) * white(8192, seed=8),  # more of it later
        0.8 * np.sin(3.0 * T) ** 3,  # of the command
    ],
)
def test_a_misfit_in_noise_does_not_pass(misfit):
    assert not passes(white(8192, seed=4) + misfit)
    assert passes(white(8192, seed=4))


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
