"""The command between two samples: the last one, a line, or the band-limited curve (rig key `hold`)."""

from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG
from scipy.signal import StateSpace, lsim

from rsea_ros.errors import RigError
from rsea_ros.model.drive import coarser, drive_from
from rsea_ros.model.propagator import propagator, state_space
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import rig_to_document
from rsea_ros.model.simulation import simulate
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
