"""What slow ramps show, and cycles that a busy driver lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benches import bench, record_bench

from rsea_ros.identification.identify import explained_by_lost_cycles, identify
from rsea_ros.identification.result import statics_of
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Fault, Record
from rsea_ros.report.identification import next_command, verdict_sentence

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


LOST = 108
LOSSES = (Fault("lost_cycles", "/rsea/driver", float("nan"), "lost_cycles on /diagnostics", LOST, "cycles"),)


def without(record: Record, lost: np.ndarray) -> Record:
    """Return the record without the samples of some cycles, which are a period behind its commands."""
    kept = {
        n: Channel(np.delete(c.t, lost - 1), np.delete(c.y, lost - 1))
        for n, c in record.channels.items()
        if n != "command"
    }
    return replace(record.with_channels(**kept), faults=LOSSES)


def lost_cycles(record: Record) -> np.ndarray:
    starts = np.random.default_rng(4).choice(len(record["command"]) // 8 - 2, LOST // 3, replace=False)
    return np.sort(np.concatenate([8 * starts + 8 + k for k in range(3)]))


@pytest.fixture(scope="module")
def busy():
    """A sound machine; in its lost cycles the motor held the torque before."""
    nominal, true = bench("paper_high_impedance", 7)
    record = record_bench(true, 7, 10.0)
    published, lost = record["command"], lost_cycles(record)
    held = published.y.copy()
    for k in lost:
        held[k] = held[k - 1]
    acted = synthesize(true, Channel(published.t, held), seed=7)
    return nominal, without(acted.with_channels(command=published), lost)


def test_lost_cycles_are_named_as_the_likely_cause(busy):
    nominal, record = busy
    result = identify([record], nominal)
    assert not result.at_noise and explained_by_lost_cycles(result) == LOST
    assert f"{LOST} lost cycles of the driver are the likely cause" in verdict_sentence(result)
    assert next_command(result) == "", "a diagnosis would seek the cause in the machine"


def test_lost_cycles_beside_a_fault_of_the_machine_are_not_named():
    """Here the motor held nothing: its torque is as far off elsewhere as behind the gaps."""
    nominal, true = bench("paper_high_impedance", 7)
    worn = true.with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    record = record_bench(worn, 7, 10.0)
    result = identify([without(record, lost_cycles(record))], nominal)
    assert not result.at_noise and explained_by_lost_cycles(result) == 0
    assert "lost cycles" not in verdict_sentence(result) and next_command(result)
