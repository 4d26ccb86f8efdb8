"""The spring's own encoder, and a spring and a sensor on the proximal side."""

from dataclasses import replace

import numpy as np
import pytest
from runs import only

from msg_adapters import read_record, write_record
from rsea_ros.errors import RigError
from rsea_ros.model import outputs
from rsea_ros.model.rig import Quantity
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.model.transfer import frequency_response
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


def test_a_bag_holds_the_deflection(tmp_path):
    record = synthesize(load_rig("sea_two_encoders"), WAVE)
    write_record(record, tmp_path / "run.mcap")
    again = read_record(tmp_path / "run.mcap")
    assert np.array_equal(again["deflection"].y, record["deflection"].y)
    write_record(only(record, "deflection"), tmp_path / "d.mcap")
    assert set(read_record(tmp_path / "d.mcap").channels) == {"command", "deflection"}


HZ = np.geomspace(0.1, 100.0, 40)
RIG = load_rig("separate_stiffnesses")


def test_an_infinitely_stiff_proximal_spring_changes_nothing():
    values = {n: q for n, q in RIG.quantities.items() if not n.startswith("proximal_spring.")}
    without = replace(RIG, quantities=values)
    stiff = RIG.with_values({"proximal_spring.stiffness": 1e11})
    for end in ("housing_end", "spring_end"):
        expected = frequency_response(without, outputs.end_torque(without, end), HZ)
        found = frequency_response(stiff, outputs.end_torque(stiff, end), HZ)
        np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_the_sensor_on_the_housing_reads_the_torque_on_that_end():
    """A slow sine through the simulation against the frequency response."""
    rate, hz = 1000.0, 3.0
    t = np.arange(round(40.0 * rate)) / rate
    command = Channel(t, np.cos(2 * np.pi * hz * t))
    damped = RIG.with_values({"housing_end.damping": 2.0, "spring_end.damping": 2.0})
    rig = replace(damped, ft_end="housing_end")
    ft = synthesize(rig, command, noise=False)["ft"]
    late = ft.t > 35.0
    wave = np.exp(2j * np.pi * hz * ft.t[late])
    ratio = np.linalg.lstsq(np.column_stack([wave.real, -wave.imag]), ft.y[late], rcond=None)[0] @ [1, 1j]
    held = np.sinc(hz / rate) * np.exp(-1j * np.pi * hz / rate)
    expected = frequency_response(rig, outputs.end_torque(rig, "housing_end"), np.array([hz]))[0] * held
    assert ratio == pytest.approx(expected, rel=2e-3)


def test_a_rig_file_keeps_the_proximal_spring(tmp_path):
    rig = replace(RIG, ft_end="housing_end")
    save_rig(rig, tmp_path / "rig.yaml")
    assert load_rig(tmp_path / "rig.yaml") == rig


def test_a_sensor_without_a_spring_is_refused():
    with pytest.raises(RigError, match=r"ft_end = housing_end without proximal_spring.stiffness, expected"):
        replace(load_rig("paper_moving_output"), ft_end="housing_end")
    with pytest.raises(RigError, match=r"ft_end = 'gear', expected one of housing_end, spring_end"):
        replace(RIG, ft_end="gear")
    with pytest.raises(RigError, match=r"proximal_spring.stiffness = 0 N·m/rad"):
        replace(RIG, quantities={**RIG.quantities, "proximal_spring.stiffness": Quantity(0.0)})


def test_an_effect_in_the_spring_is_refused_with_the_sensor_on_the_housing():
    rig = replace(RIG, ft_end="housing_end").with_effect("nonlinear_spring", cubic=3.0)
    with pytest.raises(RigError, match="nonlinear_spring with ft_end = housing_end, expected spring_end"):
        synthesize(rig, WAVE)
