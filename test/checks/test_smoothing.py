"""Which ratios of two sensors' responses are those of an average, as a table."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.checks.signal_findings import _average

PERIOD = 1.0 / 280.0


def average(f, number, *, centred):
    turn = np.pi * f * PERIOD
    size = np.sin(number * turn) / (number * np.sin(turn))
    return size if centred else size * np.exp(-1j * (number - 1.0) * turn)


def mode(f, frequency, participation, damping=0.03):
    """Response of a sensor without a mode over that of one with it."""
    rise = f**2 / (frequency**2 - f**2 + 2j * damping * frequency * f)
    return 1.0 / (1.0 + participation * rise)


@pytest.mark.parametrize("highest", [60.0, 130.0])
@pytest.mark.parametrize(("number", "centred"), [(2, False), (7, False), (15, False), (7, True), (15, True)])
def test_an_average_is_recognised_by_its_length(number, centred, highest):
    f = np.linspace(0.5, highest, 40)
    response = 3.0 * average(f, number, centred=centred)
    assert _average(f, response, np.full(40, 0.02), PERIOD) == (number, centred)


@pytest.mark.parametrize(
    ("frequency", "participation", "highest"),
    [(33.0, 0.6, 20.8), (33.0, 0.6, 24.1), (33.0, 0.3, 28.0), (60.0, 1.0, 40.0), (90.0, 1.5, 60.0)],
)
def test_a_mode_at_the_other_sensor_is_no_average(frequency, participation, highest):
    """A sound velocity beside an F/T sensor with a mode at 33 Hz was called an average of 7 samples."""
    f = np.linspace(0.5, highest, 29)
    response = 3.0 * mode(f, frequency, participation)
    assert _average(f, response, np.full(29, 0.02), PERIOD) == (1, False)


@pytest.mark.parametrize("time_constant", [2e-3, 1e-2])
def test_a_lag_is_no_average(time_constant):
    f = np.linspace(0.5, 130.0, 40)
    assert _average(f, 1.0 / (1.0 + 2j * np.pi * f * time_constant), np.full(40, 0.02), PERIOD) == (1, False)


def test_an_even_response_is_no_average():
    f = np.linspace(0.5, 130.0, 40)
    assert _average(f, np.full(40, 3.0 + 0.0j), np.full(40, 0.02), PERIOD) == (1, False)
