"""The simulated device against whole-record simulation: its time is the clock's, not the caller's."""

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.simulated import SECOND, SimulatedDevice
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.sensor_filter import SensorFilter
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Record

RATE = 280.0
START = 1_700_000_000 * SECOND


class Clock:
    """A clock that stands where it is put, ns."""

    def __init__(self):
        self.now = START

    def __call__(self):
        return self.now


def _device(rig, **options):
    clock = Clock()
    device = SimulatedDevice(rig, RATE, clock=clock, noise=False, **options)
    device.open()
    return device, clock


def _instant(seconds):
    return START + round(seconds * SECOND)


def _run(device, clock, commands, offset):
    """Write each command `offset` s into its cycle and read at the end of each."""
    states = []
    for k, command in enumerate(commands):
        clock.now = _instant((k + offset) / RATE)
        device.write(command)
        clock.now = _instant((k + 1) / RATE)
        states.append(device.read())
    return states


def _expectation(rig, commands, offset):
    """The same bench, simulated as one record with a step eight times finer."""
    t = np.arange(len(commands)) / RATE
    ends = Channel(t + 1.0 / RATE, np.zeros(len(t)))
    record = Record({"command": Channel(t + offset / RATE, commands), "ft": ends, "position": ends})
    return simulate(rig, record, refine=8)


@pytest.mark.parametrize("offset", [0.0, 0.37])
@pytest.mark.parametrize("known", [None, SensorFilter("kalman", (2000.0,))])
def test_a_command_acts_from_its_instant_on(offset, known):
    rig = load_rig("paper_high_impedance")
    rig = replace(rig, sensors={**rig.sensors, "ft": replace(rig.sensors["ft"], filter=known)})
    commands = np.random.default_rng(1).normal(0.0, 20.0, 600)
    states = _run(*_device(rig), commands, offset)
    expected = _expectation(rig, commands, offset)
    ft = np.array([s.wrench[5] for s in states])
    assert np.max(np.abs(ft - expected["ft"])) < 0.1 * rig.sensors["ft"].noise
    position = np.array([s.position for s in states])
    assert np.max(np.abs(position - expected["position"])) < 0.5 * rig.sensors["position"].noise


def test_a_stall_of_the_reader_changes_nothing():
    rig = load_rig("paper_high_impedance")
    steady, clock = _device(rig)
    steady.write(10.0)
    for k in range(1, 41):
        clock.now = _instant(k / RATE)
        expected = steady.read()
    stalled, clock = _device(rig)
    stalled.write(10.0)
    clock.now = _instant(40 / RATE)
    state = stalled.read()
    assert state.stamp == expected.stamp
    assert state.position == pytest.approx(expected.position, abs=1e-15)


def test_noise_is_the_sensors_and_repeats_with_its_seed():
    rig = load_rig("paper_high_impedance")

    def wrench(seed):
        clock = Clock()
        device = SimulatedDevice(rig, RATE, seed=seed, clock=clock)
        device.open()
        return [s.wrench[5] for s in _run(device, clock, np.zeros(2000), 0.0)]

    assert np.std(wrench(1)) == pytest.approx(rig.sensors["ft"].noise, rel=0.05)
    assert wrench(1) == wrench(1)
    assert wrench(1) != wrench(2)


def test_a_closed_device_and_an_impossible_torque_are_refused():
    device, _ = _device(load_rig("paper_high_impedance"))
    with pytest.raises(DeviceError, match="torque of nan N·m"):
        device.write(float("nan"))
    device.close()
    device.close()
    with pytest.raises(DeviceError, match="not open"):
        device.read()
