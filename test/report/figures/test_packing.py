"""Packed traces are restored to the requested resolution."""

import base64
import gzip

import numpy as np
import pytest

from rsea_ros.report.figures.overlay import pack


def unpack(values):
    """Unpack as page.js does."""
    planes = np.frombuffer(gzip.decompress(base64.b64decode(values["data"])), np.uint8).astype(int)
    low, high = np.split(planes, 2)
    whole = low + 256 * high
    back = values["first"] + values["slope"] * np.arange(len(whole)) + values["step"] * whole
    return np.where(whole == 65535, np.nan, back)


@pytest.mark.parametrize("step", [0.0, 0.01])
def test_values_come_back_to_half_a_step(step):
    values = 1e3 + np.cumsum(np.random.default_rng(1).standard_normal(5000))
    small = pack(values, step)
    assert small["step"] == pytest.approx(max(step, small["step"]))
    assert unpack(small) == pytest.approx(values, abs=0.501 * small["step"])
    assert small["step"] <= max(step, np.ptp(values) / 30_000)


def test_even_stamps_cost_nothing():
    stamps = np.arange(40_000) / 280.0
    small = pack(stamps, 1e-6)
    assert unpack(small) == pytest.approx(stamps, abs=1e-6)
    assert len(small["data"]) < 500


@pytest.mark.parametrize("values", [[], [3.0], [2.0, 2.0], [np.nan, 1.0, 2.0], [np.nan, np.nan]])
def test_short_and_broken_traces_come_back(values):
    assert unpack(pack(np.array(values))) == pytest.approx(values, nan_ok=True, abs=1e-4)
