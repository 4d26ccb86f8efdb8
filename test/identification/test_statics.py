"""What slow ramps show, and cycles that a busy driver lost."""

from dataclasses import replace

import numpy as np
import pytest
from benches import bench, record_bench
from runs import RATE, RIG, excited

from rsea_ros import simulate
from rsea_ros.identification.identify import explained_by_lost_cycles, identify
from rsea_ros.identification.result import statics_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Fault
from rsea_ros.report.identification import next_command, verdict_sentence

PEAK, K_S = 20.0, RIG["spring.stiffness"]


def ramps(rig):
    """Return what three ramps of 20 N m in 20 s each show: up, down and back."""
    t = np.arange(int(60.0 * RATE)) / RATE
    command = PEAK * 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * t / 20.0))
    return statics_of(simulate(rig, command, RATE, noise=False), rig)


def test_slow_ramps_show_stiffness_lost_motion_travel_and_limit():
    plain, played = ramps(RIG), ramps(RIG.with_effect("backlash", gap=0.01))
    assert plain.torque == pytest.approx(PEAK, rel=1e-3)
    assert plain.stiffness == pytest.approx(K_S, rel=0.01)
    assert plain.travel == pytest.approx(2.0 * 0.9875 * PEAK / K_S, rel=0.01)
    assert abs(plain.lost_motion) < 0.01 * plain.travel
    assert plain.limit is None
    rubbing = ramps(RIG.with_effect("coulomb_friction", torque=2.0))
    assert rubbing.lost_motion == pytest.approx(2.0 * 2.0 / K_S, rel=0.1)
    assert played.travel - plain.travel == pytest.approx(0.01, rel=0.02)
    assert played.stiffness == pytest.approx(plain.stiffness, rel=0.02)
    assert ramps(RIG.with_effect("torque_saturation", limit=13.0)).limit == pytest.approx(13.0, rel=0.01)


def test_a_quick_run_and_a_free_output_give_no_statics():
    assert statics_of(excited(RIG, duration=10.0, amplitude=15.0), RIG) is None
    assert ramps(load_rig("paper_moving_output")) is None


LOST = 108
LOSSES = (Fault("lost_cycles", "/rsea/driver", float("nan"), "lost_cycles on /diagnostics", LOST, "cycles"),)


def without(record, lost):
    """Return the record without the samples of some cycles, which are a period behind its commands."""
    kept = {
        n: Channel(np.delete(c.t, lost - 1), np.delete(c.y, lost - 1))
        for n, c in record.channels.items()
        if n != "command"
    }
    return replace(record.with_channels(**kept), faults=LOSSES)


def lost_cycles(record):
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
    record = record_bench(true.with_effect("coulomb_friction", torque=3.0), 7, 10.0)
    result = identify([without(record, lost_cycles(record))], nominal)
    assert not result.at_noise and explained_by_lost_cycles(result) == 0
    assert "lost cycles" not in verdict_sentence(result) and next_command(result)
