"""Decimation keeps the shape of a curve."""

import math

import pytest

from rsea_extras.watch.server import extremes


@pytest.mark.parametrize(
    ("values", "kept"),
    [
        ([], []),
        ([3.0], [3.0]),
        ([2.0, 2.0, 2.0], [2.0]),
        ([0.0, 5.0, 1.0, -2.0, 0.0], [5.0, -2.0]),
        ([0.0, -5.0, 1.0], [-5.0, 1.0]),
        ([math.nan, 1.0, math.nan], [1.0]),
    ],
)
def test_extremes_keep_their_order_in_time(values, kept):
    assert [v for _, v in extremes(list(enumerate(values)))] == kept
