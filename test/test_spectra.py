"""Spectra and fast lengths of transforms beside those of scipy, and a sine of known power."""

import numpy as np
import pytest
from scipy import signal
from scipy.fft import next_fast_len

from rsea_ros.records.statistics import cross_density, next_fast_length, power_density

RATE = 280.0


@pytest.mark.parametrize(("samples", "length"), [(1000, 128), (1000, 129), (997, 997), (64, 64), (257, 8)])
def test_as_scipy(samples, length):
    rng = np.random.default_rng(samples)
    a, b = rng.standard_normal(samples) + 3.0, rng.standard_normal(samples)
    frequency, density = power_density(a, RATE, length)
    expected_frequency, expected = signal.welch(a, RATE, nperseg=length)
    np.testing.assert_allclose(frequency, expected_frequency, rtol=1e-12)
    np.testing.assert_allclose(density, expected, rtol=1e-9, atol=1e-15)
    cross = cross_density(a, b, RATE, length)[1]
    np.testing.assert_allclose(cross, signal.csd(a, b, RATE, nperseg=length)[1], rtol=1e-9, atol=1e-15)


def test_the_density_of_a_sine_holds_its_power():
    t = np.arange(4096) / RATE
    frequency, density = power_density(0.5 + 2.0 * np.sin(2.0 * np.pi * 35.0 * t), RATE, 512)
    assert frequency[density.argmax()] == pytest.approx(35.0, abs=RATE / 512)
    assert density.sum() * RATE / 512 == pytest.approx(2.0, rel=1e-3)


def test_cross_density_shows_a_delay_as_a_falling_phase():
    noise = np.random.default_rng(5).standard_normal(9000)
    frequency, density = cross_density(noise[4:], noise[:-4], RATE, 256)
    phase = np.unwrap(np.angle(density[1:60]))
    np.testing.assert_allclose(phase, -2.0 * np.pi * frequency[1:60] * 4 / RATE, atol=0.35)


@pytest.mark.parametrize("real", [False, True])
def test_a_fast_length_is_scipys(real: bool) -> None:
    for least in (*range(1, 400), 16_801, 33_611, 67_201, 134_402, 1_000_003):
        assert next_fast_length(least, real=real) == next_fast_len(least, real=real)
