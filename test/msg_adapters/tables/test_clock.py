"""Coarse clocks: the true time is known here, and the repaired stamps must be near it."""

from __future__ import annotations

import numpy as np
import pytest

from msg_adapters.tables.importing import spread_repeats


def _true_times(rng, count, rate, wander, stalls):
    """Return sampling times whose rate wanders, with pauses."""
    phase = np.cumsum(rng.normal(size=count)) / np.sqrt(count)
    steps = (1 + wander * np.tanh(phase)) / rate
    steps[rng.integers(0, count, stalls)] += rng.uniform(0.02, 0.2, stalls)
    return np.cumsum(steps)


@pytest.mark.parametrize(("tick", "wander", "stalls"), [(1 / 64, 0.25, 0), (0.01, 0.0, 6), (0.1, 0.25, 6)])
def test_stamps_come_within_a_sample_of_the_truth(tick, wander, stalls):
    rng = np.random.default_rng(8)
    truth = _true_times(rng, 20_000, 400.0, wander, stalls)
    stamps, report = spread_repeats(np.floor(truth / tick) * tick)
    error = stamps - truth
    error -= np.median(error)
    period = (1 + wander) / 400
    assert np.all(np.diff(stamps) > 0)
    near_stall = np.zeros(truth.size, bool)
    for at in np.flatnonzero(np.diff(truth) > 0.01):
        near_stall |= np.abs(truth - truth[at]) < 0.2 + 2 * tick
    assert np.max(np.abs(error[~near_stall])) < 2 * period
    assert np.std(error[~near_stall]) < 0.5 * period
    assert np.max(np.abs(error)) < tick + 2 * period
    assert "stamps repeat" in report


@pytest.mark.parametrize("tick", [1 / 64, 0.01, 0.1])
def test_even_samples_are_dated_far_better_than_their_ticks(tick):
    truth = 3.0 + np.arange(20_000) / 280.0
    stamps, report = spread_repeats(np.round(truth / tick) * tick)
    assert np.max(np.abs(np.diff(stamps) - 1.0 / 280.0)) < 1e-6
    assert np.max(np.abs(stamps - truth)) < 0.02 * tick
    assert "fit, 280 Hz" in report


def test_a_good_clock_stays_as_it_is():
    t = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 500))
    stamps, report = spread_repeats(t)
    assert stamps is t
    assert report == ""


def test_one_repeated_stamp_moves_nothing_else():
    t = np.arange(100) * 1e-3
    t[40] = t[39]
    stamps, report = spread_repeats(t)
    others = np.arange(100) != 40
    assert np.allclose(stamps[others], t[others], rtol=0, atol=1e-12)
    assert t[39] < stamps[40] < t[41]
    assert "1 of 100 stamps repeat" in report
