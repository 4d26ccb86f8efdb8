"""Simulated channels between the ends of steps: exact where cubics are, and at the ends as they are."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.model.simulation import sample

STEPS = 40
ENDS = np.arange(STEPS + 1.0)


def test_at_the_end_of_a_step_a_channel_is_exact():
    values = np.random.default_rng(1).standard_normal(STEPS + 1)
    command = np.repeat(np.random.default_rng(2).standard_normal(STEPS // 4), 4)
    for name in ("position", "velocity", "ft"):
        assert np.array_equal(sample(name, values, ENDS, command), values)


def test_between_steps_of_one_command_a_cubic_is_exact():
    def cubic(t):
        return 0.3 - 0.2 * t + 0.01 * t**2 - 2e-3 * t**3

    at = np.linspace(0.0, STEPS, 777)
    assert sample("position", cubic(ENDS), at, np.ones(STEPS)) == pytest.approx(cubic(at), abs=1e-11)


@pytest.mark.parametrize("after", [0.25, 1.5, 3.75])
def test_a_kink_where_the_command_jumps_is_not_smoothed(after):
    """A velocity that rises before the jump and falls behind it: no point from the other side counts."""
    jump = STEPS // 2
    values = np.where(jump >= ENDS, ENDS, 2.0 * jump - ENDS)
    command = np.where(np.arange(STEPS) < jump, 1.0, -1.0)
    at = np.array([jump - after, jump + after])
    assert sample("velocity", values, at, command) == pytest.approx(jump - after, abs=1e-12)


def test_beyond_its_ends_a_channel_keeps_its_end_values():
    values = ENDS**2
    beyond = sample("ft", values, np.array([-3.0, STEPS + 3.0]), np.ones(STEPS))
    assert np.array_equal(beyond, [0.0, STEPS**2])
