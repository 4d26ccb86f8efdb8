"""The mean friction of a step, where friction is so strong that the gear comes to rest within the step."""

from __future__ import annotations

import math

import pytest

from rsea_ros.effects._friction import _implicit_mean, mean_tanh


@pytest.mark.parametrize(
    ("start", "free", "gain"),
    [(-2.416, 18.95, 30.0), (2.409, -19.98, 30.0), (0.696, -21.42, 30.0), (0.5, 2e4, 3e4), (1e-3, 40.0, 1e6)],
)
def test_the_mean_over_a_step_agrees_with_the_end_that_it_leads_to(start, free, gain):
    """Newton's method swung from one side of rest to the other for all of its 40 steps."""
    mean = _implicit_mean.py_func(start, free, gain)
    end = free - gain * mean
    along = mean_tanh.py_func(start, end, math.exp(-2.0 * abs(start)))[0]
    assert along == pytest.approx(mean, abs=2e-6)


def test_a_gear_at_rest_takes_few_steps(monkeypatch):
    """On slow machines friction is 10^6 creep velocities strong; a step took 20 rounds."""
    rounds = []

    def count(*arguments):
        rounds.append(arguments)
        return mean_tanh.py_func(*arguments)

    monkeypatch.setitem(_implicit_mean.py_func.__globals__, "mean_tanh", count)
    for share in (-0.9, -0.3, 0.0, 0.1, 0.7):
        _implicit_mean.py_func(math.atanh(0.99 * share), 1e6 * share, 1e6)
    assert len(rounds) <= 5 * 9
