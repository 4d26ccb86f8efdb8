"""The line of a channel's lag as tables: signals whose lag is known at each instant in, the line out."""

import numpy as np
import pytest

from rsea_ros.identification.clocks import _lag_of, _lags, lag_line

START, RATE = 5.0, 200.0


def instants(seconds, rate=RATE):
    return START + np.arange(int(seconds * rate)) / rate


def wave(t):
    """A signal with its slope; a second is no whole number of its periods."""
    a, b = 2.6 * np.pi, 4.2 * np.pi
    return np.sin(a * t) + np.cos(b * t), a * np.cos(a * t) - b * np.sin(b * t)


def delayed(t, lag):
    """Return that signal as a sensor stamps it that is `lag` late (s)."""
    return wave(t - lag)[0]


def line_of(lag, seconds=12.0, keep=slice(None), amplitude=1.0, start=START):
    """The line that is has_line of a lag that is given since the start of the record."""
    t = instants(seconds)[keep]
    return lag_line(t, amplitude * delayed(t, lag(t - START)), wave(t)[0], start)


@pytest.mark.parametrize("rate", [400e-6, -400e-6, 490e-6])
@pytest.mark.parametrize("first", [0.0, 1e-3])
def test_a_lag_that_grows_along_a_line_is_found_with_its_sign(rate, first):
    line = line_of(lambda since: first + rate * since)
    assert line.rate == pytest.approx(rate, rel=2e-2)
    assert line.rise == pytest.approx(12.0 * rate, rel=2e-2)
    assert line.scatter < 0.02 * abs(line.rise) and line.is_clear


@pytest.mark.parametrize(("seconds", "has_line"), [(6.9, False), (7.9, True)])
def test_a_line_needs_eight_blocks_of_a_second(seconds, has_line):
    assert (line_of(lambda since: 400e-6 * since, seconds) is not None) is has_line


def test_a_lag_that_jumps_scatters_about_its_line():
    """By a quarter of the step, and the line rises by 3/2 of the step, of blocks that show the same."""
    line = line_of(lambda since: np.where(since < 6.0, 0.0, 1.6e-3))
    assert line.scatter == pytest.approx(0.4e-3, rel=0.1)
    assert line.rise == pytest.approx(2.4e-3, rel=0.1)


def test_blocks_that_the_simulation_does_not_explain_are_left_out():
    """Four seconds of something else: the lag goes on along its line behind them."""
    t = instants(14.0)
    y = delayed(t, 500e-6 * (t - START))
    other = (t >= START + 5.0) & (t < START + 9.0)
    y[other] = np.cos(7.3 * t[other])
    line = lag_line(t, y, wave(t)[0], START)
    assert line.rate == pytest.approx(500e-6, rel=2e-2) and line.scatter < 1e-4
    assert lag_line(t, np.where(t < START + 8.0, np.cos(7.3 * t), y), wave(t)[0], START) is None


def test_a_lag_follows_a_jump_by_two_milliseconds_a_block():
    t = instants(10.0)
    lag = np.where(t < START + 4.0, 0.0, 5e-3)
    since, lags, _ = _lags(t, delayed(t, lag), wave(t)[0], START)
    assert lags == pytest.approx([0, 0, 0, 0, 2e-3, 4e-3, 5e-3, 5e-3, 5e-3, 5e-3], abs=5e-5)
    assert since == pytest.approx(np.arange(10) + 0.4975)


def test_blocks_weigh_as_much_as_they_show():
    """The second half is quiet, and its lag is off."""
    t = instants(16.0)
    loud = np.where(t < START + 8.0, 1.0, 0.01)
    lag = np.where(t < START + 8.0, 500e-6 * (t - START), 4e-3)
    line = lag_line(t, loud * delayed(t, lag), loud * wave(t)[0], START)
    assert line.rate == pytest.approx(500e-6, rel=0.02)


def test_a_simulation_at_rest_shows_no_lag():
    t = instants(2.0)
    still = np.zeros(len(t))
    assert _lag_of(t, wave(t)[0], (t, still, still), 4e-3, 2e-3) == (4e-3, 0.0)
    assert lag_line(t, wave(t)[0], still, START) is None
