"""A command that repeats, and one that is merely slow."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.frequency_response import find_periods

T = np.arange(1246) / 50.0


def test_a_slow_command_does_not_repeat_at_every_sample():
    """Targets at tens of Hz move less than the tolerance from one to the next."""
    assert find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.05 * T)) is None


def test_a_slow_command_that_does_repeat_has_its_period():
    periods = find_periods(0.5 + 0.15 * np.cos(2 * np.pi * 0.15 * T))
    assert periods is not None
    assert (periods.length, periods.count) == (333, 3)
