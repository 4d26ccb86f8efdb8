"""Held by either end, either train, lumped or not: the table's inertias and each of the limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.model import outputs
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.train import TRAINS
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.bands import HZ, arrangements, limits

LIMITS = limits(load_rig("paper_moving_output"))


@pytest.mark.parametrize("held", ["T-RSEA", "RT-RSEA"])
@pytest.mark.parametrize("index", range(len(TRAINS)), ids=TRAINS)
def test_the_table_has_the_right_transfer_functions(index, held):
    rig = load_rig("paper_high_impedance")
    row = arrangements(rig)[index]
    rig = replace(rig, train=row.train, proximal="housing_end" if held == "T-RSEA" else "spring_end")
    s = 2j * np.pi * HZ
    den = row.outer * s**2 + (23.088 + 3.0) * s + 1530.456
    expected = [(3.0 * s + 1530.456) / den, (row.inner * s**2 + 3.0 * s + 1530.456) / den]
    torques = [outputs.distal(rig), outputs.proximal(rig)]
    for torque, value in zip(torques, expected if held == "T-RSEA" else expected[::-1], strict=True):
        np.testing.assert_allclose(frequency_response(rig, torque, HZ), value, rtol=1e-9)


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.what)
def test_every_limit_is_reached(limit):
    if len(limit.values) == 1:
        assert limit.errors[0] < 1e-12
        return
    assert limit.errors[-1] < 3e-3
    order = np.log10(limit.errors[-2] / limit.errors[-1]) / np.log10(limit.values[-1] / limit.values[-2])
    assert order == pytest.approx(1.0, abs=0.15)
