"""Sensors that freeze together are named, each of them; a machine that stands still is not."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from rsea_ros.checks.check import check_record
from rsea_ros.checks.faults import check
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RIG = load_rig("paper_high_impedance")
RATE, LENGTH = 280.0, 12.0


@functools.cache
def run():
    u = excitation("white_noise", ExcitationSettings(rate=RATE, duration=LENGTH, seed=1))
    return synthesize(RIG, Channel(np.arange(len(u)) / RATE, u))


def freeze(record, names, start, stop=LENGTH + 1.0):
    """Return the record with the values of some channels held between two times, s."""
    held = {}
    for name in names:
        t, y = record[name].t, record[name].y.copy()
        at = (t > start) & (t < stop)
        y[at] = y[np.argmax(at)]
        held[name] = Channel(t, y)
    return record.with_channels(**held)


def frozen_channels(record):
    return {f.channel for f in check(record, RIG).faults if f.kind == "frozen_samples"}


@pytest.mark.parametrize(
    "names",
    [
        ("position", "velocity", "ft"),
        ("position", "velocity", "ft", "motor_torque"),
        ("position", "ft"),
        ("position", "velocity"),
        ("ft",),
    ],
)
@pytest.mark.parametrize("span", [(1.0,), (4.0,), (4.0, 6.0), (10.5,)])
def test_every_channel_of_a_driver_that_stops_is_named(names, span):
    assert frozen_channels(freeze(run(), names, *span)) == set(names)


@pytest.mark.parametrize("stop", [4.3, 4.6, 7.0])
@pytest.mark.parametrize("others", [(), ("motor_torque",)])
@pytest.mark.parametrize("kind", ["white_noise", "chirp"])
def test_sensors_with_noise_that_hold_at_once_are_frozen_whether_or_not_the_machine_moved(kind, others, stop):
    """Nothing under 0.5 s was said; of 3 s the position was left in: 1.12 times the noise, "unexplained"."""
    u = excitation(kind, ExcitationSettings(rate=RATE, duration=20.0, seed=1))
    record = synthesize(RIG, Channel(np.arange(len(u)) / RATE, u))
    names = ("position", "velocity", "ft", *others)
    checked = check(freeze(record, names, 4.0, stop), RIG)
    for name in names:
        at = checked.record[name].t
        assert checked.masked[name][(at > 4.0 + 2 / RATE) & (at < stop)].all()


def test_it_is_said_from_when_to_when_and_not_that_the_machine_is_another_or_a_sensor_noisy():
    findings = check_record(freeze(run(), ("position", "velocity", "ft"), 4.0, 6.0), RIG).findings
    assert {f.kind for f in findings if f.light != "green"} == {"frozen_samples"}
    assert all("from 4.007 s to 5.996 s" in f.detail for f in findings if f.kind == "frozen_samples")


@pytest.mark.parametrize("noise", [False, True])
def test_a_machine_that_sticks_while_the_command_goes_on_is_not_frozen(noise):
    """Dry friction of 15 N m under a slow command of 20 N m: all sensors without noise hold for seconds."""
    rig = RIG.with_effects(EffectSetting("coulomb_friction", {"torque": 15.0}))
    t = np.arange(int(20.0 * RATE)) / RATE
    record = synthesize(rig, Channel(t, 20.0 * np.sin(2.0 * np.pi * 0.1 * t)), noise=noise)
    assert frozen_channels(record) == set()


def test_a_velocity_that_is_the_rate_of_the_position_is_steady():
    """A drive under a constant torque reaches its speed, which a coarse sensor shows as one value."""
    rig = load_rig("bare_drive")
    t = np.arange(int(10.0 * RATE)) / RATE
    record = synthesize(rig, Channel(t, 10.0 * np.sign(np.sin(2.0 * np.pi * t / 4.0))), noise=False)
    noise = Channel(t, np.random.default_rng(5).standard_normal(len(t)))
    assert {f.channel for f in check(record.with_channels(ft=noise), rig).faults} == set()
    stopped = record.with_channels(velocity=freeze(record, ("velocity",), 4.0)["velocity"], ft=noise)
    assert {f.channel for f in check(stopped, rig).faults} == {"velocity"}
