"""Slow ramps against a locked output: the values that are read off are those of the bench."""

from __future__ import annotations

import numpy as np
import pytest
from benches import bench, record_bench

from rsea_ros.identification.result import statics_of
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

PEAK, RATE = 20.0, 280.0


def ramps(rig: Rig) -> Record:
    """Return three ramps of 20 N m in 20 s each, up, down and back."""
    t = np.arange(int(60.0 * RATE)) / RATE
    return synthesize(
        rig, Channel(t, PEAK * 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * t / 20.0))), noise=False
    )


def with_effect(name: str, **parameters: float) -> Rig:
    rig = load_rig("paper_high_impedance")
    return rig.with_effects(EffectSetting(name, parameters))


def test_a_plain_spring_has_its_stiffness():
    rig = load_rig("paper_high_impedance")
    statics = statics_of(ramps(rig), rig)
    assert statics is not None
    assert statics.torque == pytest.approx(PEAK, rel=1e-3)
    assert statics.stiffness == pytest.approx(rig["spring.stiffness"], rel=0.01)
    assert statics.travel == pytest.approx(2.0 * 0.9875 * PEAK / rig["spring.stiffness"], rel=0.01)
    assert abs(statics.lost_motion) < 0.01 * statics.travel
    assert statics.limit is None


def test_friction_is_lost_motion():
    rig = with_effect("coulomb_friction", torque=2.0)
    statics = statics_of(ramps(rig), rig)
    assert statics is not None
    assert statics.lost_motion == pytest.approx(2.0 * 2.0 / rig["spring.stiffness"], rel=0.1)


def test_backlash_is_travel():
    rig = with_effect("backlash", gap=0.01)
    plain = statics_of(ramps(load_rig("paper_high_impedance")), rig)
    statics = statics_of(ramps(rig), rig)
    assert statics is not None and plain is not None
    assert statics.travel - plain.travel == pytest.approx(0.01, rel=0.02)
    assert statics.stiffness == pytest.approx(plain.stiffness, rel=0.02)


def test_saturation_is_its_limit():
    rig = with_effect("torque_saturation", limit=13.0)
    statics = statics_of(ramps(rig), rig)
    assert statics is not None and statics.limit == pytest.approx(13.0, rel=0.01)


def test_a_quick_run_and_a_free_output_give_no_statics():
    _, true = bench("paper_high_impedance", 1)
    assert statics_of(record_bench(true, 1), true) is None
    moving = load_rig("paper_moving_output")
    assert statics_of(ramps(moving), moving) is None
