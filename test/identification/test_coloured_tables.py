"""Noise or misfit: residuals that pass for noise of a sensor, and misfits too small to be seen and not."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from rsea_ros.identification.noise import unit_spectra
from rsea_ros.identification.noise_level import _coherent_share, is_noise

RATE = 256.0


def white(size, seed=0):
    return np.random.default_rng(seed).normal(size=size)


def case(y, rate=RATE):
    """A case of one channel, measured beside an output of zero, with a motion of which it shows nothing."""
    t = np.arange(len(y)) / rate
    drive = SimpleNamespace(t=t, torque=np.sin(3.0 * t), q=np.cos(5.0 * t), v=np.sin(7.0 * t))
    all_count = {"ft": np.ones(len(y), bool)}
    return SimpleNamespace(t={"ft": t}, mask=all_count, measured={"ft": y}, drive=drive, filters={})


def passes(y, **more):
    return is_noise(case(y, **more), {"ft": np.zeros(len(y))}, "ft")


def test_short_and_empty_records_decide_nothing():
    assert passes(white(1500)) and not passes(white(1499))
    assert not passes(np.zeros(2000))
    assert passes(np.where(np.arange(2000) % 9, white(2000), 0.0)), "some zeros are allowed"


@pytest.mark.parametrize(("rate", "memory"), [(100.0, 0.97), (256.0, 0.0), (256.0, 0.9), (1000.0, 0.97)])
def test_noise_of_first_order_passes(rate, memory):
    assert passes(lfilter([1.0], [1.0, -memory], white(9000, seed=3))[1000:], rate=rate)


T = np.arange(8192) / RATE
MISFITS = {
    "an offset": (0.25, 0.4, np.ones(8192)),
    "a drift": (0.3, 1.0, np.linspace(-1.0, 1.0, 8192)),
    "a slow wave": (0.1, 0.15, np.sin(2 * math.pi * 0.15 * T)),
    "a line": (0.2, 0.35, np.sin(2 * math.pi * 40.0 * T)),
    "knocks": (4.0, 5.0, np.where(np.arange(8192) % 256 == 0, 1.0, 0.0)),
    "more of it later": (0.5, 0.65, np.where(T > 16.0, white(8192, seed=8), 0.0)),
    "of the command": (0.15, 0.3, np.sin(3.0 * T) ** 3),
}
"""Its size, of the noise, that still passes; the one that is seen; and its course."""


@pytest.mark.parametrize("misfit", MISFITS)
def test_a_misfit_in_noise_passes_only_while_it_is_small(misfit):
    small, large, course = MISFITS[misfit]
    noise = white(8192, seed=4)
    assert passes(noise + small * course)
    assert not passes(noise + large * course)


def test_a_ripple_over_the_rotors_angle_is_a_misfit_once_the_gears_ratio_is_known():
    turning = case(white(8192, seed=4) + 0.45 * np.sin(50.2 * np.sin(2.0 * T)))
    turning.drive.q = 0.1 * np.sin(2.0 * T)
    outputs = {"ft": np.zeros(8192)}
    assert is_noise(turning, outputs, "ft")
    assert not is_noise(turning, outputs, "ft", ratio=502.0)


def test_kurtosis_is_that_of_the_whitened_residual():
    """Smoothing makes anything Gaussian; what was smoothed is not. Flatter than Gaussian is noise too."""
    rng = np.random.default_rng(2)
    assert not passes(lfilter([1.0], [1.0, -0.97], rng.standard_t(5, 2**16)))
    assert passes(lfilter([1.0], [1.0, -0.97], rng.uniform(-1.0, 1.0, 2**16)))


def share(a, b):
    return _coherent_share(unit_spectra(a, 512, 16), unit_spectra(b, 512, 16), RATE)


@pytest.mark.parametrize(("gain", "expected"), [(0.0, 0.0), (0.5, 0.2), (-1.0, 0.5), (1e6, 1.0)])
def test_the_coherent_share_of_the_power_is_measured(gain, expected):
    witness = white(2**15, seed=1)
    assert share(white(2**15) + gain * witness, 1e3 * witness) == pytest.approx(expected, abs=0.04)


def test_coherence_is_corrected_for_chance():
    """Of 16 segments, 31 half overlapping, one in 29 of the power agrees by chance, in no band more."""
    one_band = [share(white(8192, seed=k), white(8192, seed=1000 + k)) for k in range(40)]
    assert -0.01 < np.mean(one_band) < 0.05  # the worst of four bands
