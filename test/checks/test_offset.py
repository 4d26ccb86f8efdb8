"""An F/T zero beyond any torque of the run is said; a usual one is left to the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

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


@pytest.mark.parametrize(("zero", "said"), [(0.0, False), (100.0, True), (-0.5, True)])
def test_an_angle_whose_zero_is_elsewhere_is_told_from_a_wrong_rig(zero, said):
    """A count of turns in the position made the whole simulation wild: three sensors of a wrong rig."""
    moved = RUN.with_channels(position=Channel(RUN["position"].t, RUN["position"].y + zero))
    findings = check_record(moved, RIG)
    assert [(f.channel, f.light) for f in findings.of("offset")] == ([("position", "red")] if said else [])
    assert [f.channel for f in findings.of("wrong_rig") if f.light != "green"] == []
    unknown = replace(RIG.sensors["position"], zero_unknown=True)
    knowing = replace(RIG, sensors={**RIG.sensors, "position": unknown})
    assert check_record(moved, knowing).of("offset") == ()


@pytest.mark.parametrize("zero", [100.0])
def test_a_fit_compares_the_changes_of_an_angle_whose_zero_is_elsewhere(zero):
    """15976725 times the noise, beside a line that said what is wrong."""
    moved = RUN.with_channels(position=Channel(RUN["position"].t, RUN["position"].y + zero))
    fit = rsea.identify(moved, RIG)
    assert max(fit.result.times_noise.values()) < 1.2
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=2.0)
