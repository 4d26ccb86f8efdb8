"""How often a log repeats the values of a sensor."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.records.holds import repeats_of

VALUES = np.random.default_rng(2).standard_normal(400)


@pytest.mark.parametrize("times", [1, 3, 7])
@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_repeats_are_counted_at_any_size(times, size):
    assert repeats_of(size * np.repeat(VALUES, times)) == times


@pytest.mark.parametrize("odd", [np.nan, np.inf])
def test_a_channel_with_a_value_that_is_no_number_is_left_to_the_checks(odd):
    """inf - inf was a warning on the terminal of `predict`."""
    assert repeats_of(np.repeat(np.where(np.arange(400) > 200, odd, VALUES), 7)) == 1
