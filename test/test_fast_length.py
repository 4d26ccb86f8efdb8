"""Fast lengths of Fourier transforms, against scipy's."""

from __future__ import annotations

import pytest
from scipy.fft import next_fast_len

from rsea_ros.records.statistics import next_fast_length


@pytest.mark.parametrize("real", [False, True])
def test_a_fast_length_is_scipys(real: bool) -> None:
    for least in (*range(1, 400), 16_801, 33_611, 67_201, 134_402, 1_000_003):
        assert next_fast_length(least, real=real) == next_fast_len(least, real=real)
