"""The spring's own encoder: in the simulation, behind play, and in a bag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msg_adapters import read_record, write_record
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import load_rig, rig_to_document
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.records.record import Channel, Record

T = np.arange(2000) / 500.0
WAVE = Channel(T, 3.0 * np.sin(2 * np.pi * 3.0 * T))


def sensor_values(rig):
    """Return what the sensors of a rig would see without noise."""
    blank = Channel(T + 2e-3, np.zeros(len(T)))
    return simulate(rig, Record({"command": WAVE, **dict.fromkeys(("ft", "deflection", "position"), blank)}))


def test_the_deflection_is_torque_over_stiffness_without_damping():
    rig = load_rig("sea_two_encoders").with_values({"spring.damping": 0.0})
    out = sensor_values(rig)
    assert np.allclose(out["ft"], rig["spring.stiffness"] * out["deflection"], rtol=1e-9, atol=1e-12)
    assert np.allclose(out["deflection"], out["position"], atol=1e-15)  # both ends are clamped


def test_behind_play_the_deflection_is_that_of_the_spring():
    rig = load_rig("sea_two_encoders").with_values({"spring.damping": 0.0, "chassis.inertia": 1e-3})
    out = sensor_values(rig.with_effect("backlash", gap=1e-3))
    assert np.max(np.abs(out["deflection"] - out["position"])) == pytest.approx(5e-4, rel=1e-3)
    assert np.allclose(out["ft"], rig["spring.stiffness"] * out["deflection"], rtol=1e-6, atol=1e-9)


def test_with_a_moving_end_the_deflection_is_not_the_position():
    rig = load_rig("two_moving_outputs")
    out = sensor_values(rig)
    assert np.std(out["deflection"] - out["position"]) > 0.5 * np.std(out["deflection"])


def test_only_a_rig_that_lists_the_deflection_logs_it():
    assert "deflection" not in synthesize(load_rig("paper_high_impedance"), WAVE)
    record = synthesize(load_rig("sea_two_encoders"), WAVE, seed=1)
    noise = record["deflection"].y - sensor_values(load_rig("sea_two_encoders"))["deflection"]
    assert np.std(noise) == pytest.approx(2e-5, rel=0.1)


def test_a_bag_holds_the_deflection(tmp_path):
    record = synthesize(load_rig("sea_two_encoders"), WAVE)
    write_record(record, tmp_path / "run.mcap")
    again = read_record(tmp_path / "run.mcap")
    assert np.array_equal(again["deflection"].y, record["deflection"].y)
    write_record(
        replace(record, channels={n: record[n] for n in ("command", "deflection")}), tmp_path / "d.mcap"
    )
    assert set(read_record(tmp_path / "d.mcap").channels) == {"command", "deflection"}


def test_a_rig_may_state_the_doubt_of_a_clock():
    rig = load_rig("sea_two_encoders")
    assert rig.clock_doubt("deflection") == 5e-3
    assert rig.clock_doubt("ft") == 1e-4
    late = replace(rig, sensors={**rig.sensors, "ft": Sensor(noise=0.02, clock=1e-3, clock_doubt=2e-3)})
    assert rig_from_document(rig_to_document(late)) == late
