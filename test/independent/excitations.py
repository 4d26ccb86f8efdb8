"""Commands of a test, N m, shape (n,), on a uniform grid: the paper's chirp with noise, and a multisine."""

import numpy as np

RATE = 280.0


def chirp_noise(duration, rng, amplitude=20.0, noise=10.0, rate=RATE):
    """Logarithmic sweep 0.01-140 Hz plus Gaussian noise (paper, section 3.2.1)."""
    t = np.arange(round(duration * rate)) / rate
    low, high = 0.01, 140.0
    growth = np.log(high / low) / duration
    phase = 2.0 * np.pi * low / growth * np.expm1(growth * t)
    return amplitude * np.sin(phase) + noise * rng.normal(size=t.size)


def odd_multisine(duration, rng, rms=17.0, period=10.0, high=120.0, rate=RATE):
    """Random-phase sum of the odd harmonics of 1/period up to `high` Hz, repeated; more of it below 10 Hz."""
    n = round(period * rate)
    line = np.arange(1, int(high * period), 2)
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[line] = np.exp(2j * np.pi * rng.random(line.size)) / np.sqrt(1.0 + line / period / 10.0)
    one = np.fft.irfft(spectrum, n)
    one *= rms / one.std()
    return np.resize(one, round(duration * rate))


def white_noise(duration, rng, deviation=30.0, rate=RATE):
    """Gaussian white noise (paper, section 3.2.2)."""
    return deviation * rng.normal(size=round(duration * rate))


EXCITATIONS = {"chirp_noise": chirp_noise, "multisine": odd_multisine, "white_noise": white_noise}
