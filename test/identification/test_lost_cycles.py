"""Cycles that a busy driver lost: the verdict names them where the motor torque shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benches import bench, record_bench

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.identify import explained_by_lost_cycles, identify
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Fault, Record
from rsea_ros.report.identification.words import next_command, verdict_sentence

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


def test_a_diagnosis_warns_that_its_causes_may_stand_in_for_lost_cycles(busy):
    nominal, record = busy
    others = tuple(name for name in catalogue() if name != "current_loop_lag")
    codes = [r.code for r in diagnose([record], nominal, settings=DiagnosisSettings(without=others)).remarks]
    assert codes[0] == "lost_cycles"


def test_lost_cycles_beside_a_fault_of_the_machine_are_not_named():
    """Here the motor held nothing: its torque is as far off elsewhere as behind the gaps."""
    nominal, true = bench("paper_high_impedance", 7)
    worn = true.with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    record = record_bench(worn, 7, 10.0)
    result = identify([without(record, lost_cycles(record))], nominal)
    assert not result.at_noise and explained_by_lost_cycles(result) == 0
    assert "lost cycles" not in verdict_sentence(result) and next_command(result)
