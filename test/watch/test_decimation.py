"""Decimation keeps what a picture shows."""

import math

import pytest

from rsea_ros.watch.decimation import extremes


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
def test_extremes_in_the_order_in_which_they_came(values, kept):
    assert [v for _, v in extremes(list(enumerate(values)))] == kept
