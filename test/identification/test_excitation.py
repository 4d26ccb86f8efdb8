"""Excitations: their spectra, sizes and periods against what the definitions say."""

import numpy as np
import pytest
from scipy import signal

from rsea_ros.errors import ParameterError
from rsea_ros.identification.excitation import (
    KINDS,
    ExcitationSettings,
    check_limits,
    chirp,
    excitation,
    multisine,
    odd_lines,
    steps,
    white_noise,
)

PAPER = ExcitationSettings()


def _power(command, rate):
    """One-sided power of each line, N^2 m^2: sums to the mean square."""
    spectrum = np.abs(np.fft.rfft(command)) ** 2 / len(command) ** 2
    spectrum[1:-1] *= 2.0
    return np.fft.rfftfreq(len(command), 1.0 / rate), spectrum


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_finite_reproducible_and_begins_and_ends_at_rest(kind):
    settings = ExcitationSettings(duration=20.0, seed=3)
    command = excitation(kind, settings, ramp=0.5)
    assert np.all(np.isfinite(command))
    assert command[0] == 0.0 and command[-1] == 0.0
    assert np.array_equal(command, excitation(kind, settings, ramp=0.5))
    assert len(command) / settings.rate == pytest.approx(20.0 + (1.0 if kind == "multisine" else 0.0))


def test_chirp_without_noise_is_scipys_logarithmic_chirp():
    settings = ExcitationSettings(noise=0.0)
    t = np.arange(44_800) / 280.0
    expected = 20.0 * signal.chirp(t, 0.01, 160.0, settings.top, "logarithmic", phi=-90.0)
    np.testing.assert_allclose(chirp(settings), expected, rtol=0.0, atol=1e-6)


def test_noise_has_its_deviation_and_is_white_in_its_band_only():
    settings = ExcitationSettings(amplitude=10.0, low=1.0, high=100.0, seed=5)
    noise = white_noise(settings)
    assert np.std(noise) == pytest.approx(10.0, rel=0.02)
    frequency, power = _power(noise, settings.rate)
    assert power[(frequency < 0.99) | (frequency > 100.01)].sum() < 1e-20
    lower, upper = (power[(frequency >= a) & (frequency < b)].sum() for a, b in ((1.0, 50.5), (50.5, 100.0)))
    assert lower == pytest.approx(upper, rel=0.05)


def test_chirps_noise_adds_to_the_sweep():
    noise = chirp(PAPER) - chirp(ExcitationSettings(noise=0.0))
    assert np.std(noise) == pytest.approx(10.0, rel=0.02)
    assert not np.array_equal(chirp(PAPER), chirp(ExcitationSettings(seed=1)))


def test_multisine_has_power_on_its_odd_lines_alone_and_equal():
    settings = ExcitationSettings(duration=30.0, amplitude=8.0, low=0.2, high=60.0, seed=2)
    command = multisine(settings)
    assert np.sqrt(np.mean(command**2)) == pytest.approx(8.0)
    one = command[:2800]
    assert np.allclose(command, np.tile(one, 3), atol=1e-9)
    _, power = _power(one, settings.rate)
    lines = odd_lines(settings)
    assert set(np.flatnonzero(power > 1e-12)) == set(lines)
    assert np.ptp(power[lines]) < 1e-9
    assert np.all(lines % 2 == 1) and lines[0] >= 2 and lines[-1] <= 600


def test_multisine_leaves_out_a_quarter_of_the_odd_lines_for_detection():
    settings = ExcitationSettings(low=0.2, high=60.0)
    missing = set(range(3, 600, 2)) - set(odd_lines(settings))
    assert len(missing) == 299 // 4
    assert missing != set(range(3, 600, 2)) - set(odd_lines(ExcitationSettings(low=0.2, high=60.0, seed=1)))


def test_steps_hold_their_levels():
    command = steps(ExcitationSettings(duration=8.0, amplitude=5.0, period=4.0, rate=100.0))
    assert np.array_equal(command[::100], [0.0, 5.0, 0.0, -5.0, 0.0, 5.0, 0.0, -5.0])
    assert np.count_nonzero(np.diff(command)) == 7


def test_ramp_is_a_raised_cosine():
    settings = ExcitationSettings(duration=4.0, period=1e6, rate=100.0, amplitude=2.0)
    command = excitation("white_noise", settings, ramp=1.0) / excitation("white_noise", settings)
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(100) / 100.0))
    assert command[:100] == pytest.approx(rise)
    assert command[-100:] == pytest.approx(rise[::-1])
    assert command[100:-100] == pytest.approx(1.0)


def test_limit_names_value_unit_limit_and_time():
    command = np.zeros(100)
    command[50] = -30.0
    check_limits(command, 30.0, 100.0)
    with pytest.raises(ParameterError, match=r"-30 N·m at 0\.500 s .* at most 29 N·m"):
        check_limits(command, 29.0, 100.0)
    command[20] = np.nan
    with pytest.raises(ParameterError, match=r"at 0\.200 s"):
        check_limits(command, 100.0, 100.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: excitation("sweep", PAPER), "expected one of chirp"),
        (lambda: ExcitationSettings(duration=float("nan")), "duration = nan s"),
        (lambda: ExcitationSettings(low=133.0), "low = 133 Hz"),
        (lambda: excitation("steps", ExcitationSettings(duration=1.0), ramp=0.6), "ramp = 0.6 s, expected 0"),
        (lambda: multisine(ExcitationSettings(period=0.0101)), "whole number of samples"),
        (lambda: multisine(ExcitationSettings(period=1.0, low=1.1, high=1.9)), "odd lines in 1.1 to 1.9 Hz"),
    ],
)
def test_settings_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ParameterError, match=message):
        call()
