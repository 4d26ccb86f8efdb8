"""Between samples: the command (rig key `hold`: the last one, a line, a curve), and simulated channels."""

from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG
from scipy.signal import StateSpace, lsim

import rsea_ros as rsea
from rsea_ros.errors import RigError
from rsea_ros.model.drive import coarser, drive_from
from rsea_ros.model.propagator import propagator, state_space
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import rig_to_document
from rsea_ros.model.simulation import sample, simulate
from rsea_ros.records.record import Channel, Record


def record_of(command, shift=0.0):
    """Return a record that asks for position and torque `shift` periods after each command."""
    t = np.arange(len(command)) / RATE
    blank = {n: Channel(t + shift / RATE, np.zeros(len(t))) for n in ("position", "ft")}
    return Record({"command": Channel(t, command), **blank}, source="bag")


def continuous(u, t):
    """Return position and torque of the rig for a signal that goes straight between many instants."""
    system = state_space(RIG)
    rows = propagator(RIG, 1e-3, set()).outputs[[0, 2]]
    _, y, _ = lsim(StateSpace(system.a, system.b[:, :1], rows, np.zeros((2, 1))), u, t)
    return y.T


@pytest.mark.parametrize("shift", [0.0, 0.31])
def test_a_line_connects_commands(shift):
    command = np.clip(15 * np.random.default_rng(0).standard_normal(300), -40, 40)
    ours = simulate(replace(RIG, hold="first"), record_of(command, shift))
    fine = np.arange(0.0, 300.0, 0.01) / RATE
    true = continuous(np.interp(fine, np.arange(300) / RATE, command), fine)
    wanted = (np.arange(5, 290) + shift) / RATE
    for name, y, noise in zip(("position", "ft"), true, (6.2e-6, 0.03), strict=True):
        error = ours[name][5:290] - np.interp(wanted, fine, y)
        assert np.sqrt(np.mean(error**2)) < 0.5 * noise, name


def test_a_band_limited_curve_connects_commands():
    """Sines up to 0.35 of the rate: a line between the samples loses a third of the highest."""
    fine = np.arange(0.0, 2.0, 1e-4)
    frequencies = (3.0, 21.0, 55.0, 98.0)

    def signal(t):
        return sum(8.0 * np.sin(2 * np.pi * f * t + f) for f in frequencies)

    t = np.arange(int(2.0 * RATE)) / RATE
    true = continuous(signal(fine), fine)[1]
    errors = {}
    for hold in ("zero", "first", "band"):
        error = simulate(replace(RIG, hold=hold), record_of(signal(t)))["ft"] - np.interp(t, fine, true)
        errors[hold] = float(np.sqrt(np.mean(error[60:-60] ** 2)))
    assert 10.0 * errors["band"] < errors["first"] < errors["zero"], errors


def test_a_held_command_acts_as_before():
    command = np.random.default_rng(1).standard_normal(100)
    drive = drive_from(record_of(command))
    np.testing.assert_array_equal(drive.command, drive_from(record_of(command), hold="zero").command)
    assert drive.jumps and not drive_from(record_of(command), hold="band").jumps
    line = drive_from(record_of(command), hold="first")
    assert coarser(line) is line


def test_a_rig_file_states_the_hold():
    document = rig_to_document(replace(RIG, hold="band"))
    assert rig_from_document(document).hold == "band" and "hold" not in rig_to_document(RIG)
    with pytest.raises(RigError, match="hold = 'second', expected zero, first, band"):
        rig_from_document(document | {"hold": "second"})


STEPS = 40
ENDS = np.arange(STEPS + 1.0)


def test_at_the_end_of_a_step_a_channel_is_exact():
    values = np.random.default_rng(1).standard_normal(STEPS + 1)
    command = np.repeat(np.random.default_rng(2).standard_normal(STEPS // 4), 4)
    for name in ("position", "velocity", "ft"):
        assert np.array_equal(sample(name, values, ENDS, command), values)


def test_between_steps_of_one_command_a_cubic_is_exact():
    def cubic(t):
        return 0.3 - 0.2 * t + 0.01 * t**2 - 2e-3 * t**3

    at = np.linspace(0.0, STEPS, 777)
    assert sample("position", cubic(ENDS), at, np.ones(STEPS)) == pytest.approx(cubic(at), abs=1e-11)


@pytest.mark.parametrize("after", [0.25, 1.5, 3.75])
def test_a_kink_where_the_command_jumps_is_not_smoothed(after):
    """A velocity that rises before the jump and falls behind it: no point from the other side counts."""
    jump = STEPS // 2
    values = np.where(jump >= ENDS, ENDS, 2.0 * jump - ENDS)
    command = np.where(np.arange(STEPS) < jump, 1.0, -1.0)
    at = np.array([jump - after, jump + after])
    assert sample("velocity", values, at, command) == pytest.approx(jump - after, abs=1e-12)


def test_beyond_its_ends_a_channel_keeps_its_end_values():
    values = ENDS**2
    beyond = sample("ft", values, np.array([-3.0, STEPS + 3.0]), np.ones(STEPS))
    assert np.array_equal(beyond, [0.0, STEPS**2])


def test_a_sensor_that_is_known_to_be_late_shows_what_was(tmp_path):
    """A delay of one period is the sample before, through a file and back; one below zero is refused."""
    rig = rsea.load_rig("paper_high_impedance")
    late = replace(rig, sensors={**rig.sensors, "ft": replace(rig.sensors["ft"], delay=1.0 / 280.0)})
    rsea.save(late, tmp_path / "late.yaml")
    command = 15.0 * np.random.default_rng(0).standard_normal(280)
    now = rsea.simulate(rig, command, 280.0, noise=False)["ft"].y
    before = rsea.simulate(tmp_path / "late.yaml", command, 280.0, noise=False)["ft"].y
    assert before[1:] == pytest.approx(now[:-1], abs=1e-6 * np.abs(now).max())
    text = (tmp_path / "late.yaml").read_text().replace("value: 0.0035", "value: -0.0035")
    (tmp_path / "early.yaml").write_text(text)
    with pytest.raises(rsea.RseaError, match=r"sensors\.ft\.delay\.value = -0\.0035.*expected 0 or more"):
        rsea.load_rig(tmp_path / "early.yaml")
