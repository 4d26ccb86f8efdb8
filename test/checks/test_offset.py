"""An F/T zero beyond any torque of the run is said; a usual one is left to the fit."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.checks.check import check_record
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.signals import Channel

RIG = load_rig("paper_high_impedance")
U = excitation("white_noise", ExcitationSettings(rate=280.0, duration=6.0, seed=1))
RUN = synthesize(RIG, Channel(np.arange(len(U)) / 280.0, U))


@pytest.mark.parametrize(
    ("offset", "light"), [(0.0, None), (5.0, None), (-90.0, "amber"), (300.0, "red"), (-300.0, "red")]
)
def test_an_offset_that_no_torque_explains_is_a_finding_and_a_fault(offset, light):
    findings = check_record(RUN.with_channels(ft=Channel(RUN["ft"].t, RUN["ft"].y + offset)), RIG)
    assert [f.light for f in findings.of("offset")] == ([light] if light else [])
    for f in findings.of("offset"):
        assert f.value == pytest.approx(offset, abs=2.0)
    assert [f.channel for f in findings.faults if f.kind == "offset"] == (["ft"] if light else [])
