"""Dead and frozen channels are named; rest, standstill and plateaus are neither."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from independent.bench import drawn_bench, record_command, record_run
from independent.excitations import chirp_noise
from independent.hidden import hide
from scipy.signal import lfilter

from rsea_ros.checks.carried import check_diagnosable, with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.checks.faults import clipping, dead_channels
from rsea_ros.errors import IdentificationError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Fault

RIG = load_rig("paper_high_impedance")
BENCH = drawn_bench(np.random.default_rng(2))
QUIET = BENCH.with_values(ft_noise=0.0, velocity_noise=0.0, motor_noise=0.0)
N = 280 * 12
COMMAND = chirp_noise(12.0, np.random.default_rng(3))
IN_TURNS = (np.arange(N) // 600) % 2 == 0


@functools.cache
def good():
    return record_run(BENCH, 4, duration=12.0)


def with_channel(channel, y):
    return good().with_channels(**{channel: Channel(good()[channel].t, np.asarray(y, float))})


def kinds(record):
    return {(f.kind, f.channel) for f in check_record(record, RIG).faults}


RNG = np.random.default_rng(0)
DEAD = {
    "zero": np.zeros(N),
    "constant": np.full(N, 3.2),
    "its own noise": 0.03 * RNG.normal(size=N),
    "loud noise": 30.0 * RNG.normal(size=N),
    "a walk": np.cumsum(RNG.normal(size=N)),
    "mains": 0.5 * np.sin(2.0 * np.pi * 50.0 * np.arange(N) / 280.0) + 0.03 * RNG.normal(size=N),
}


@pytest.mark.parametrize("name", DEAD)
def test_a_dead_sensor_is_named(name):
    assert kinds(with_channel("ft", DEAD[name])) == {("dead_channel", "ft")}


@pytest.mark.parametrize(
    ("channel", "noise"), [("position", 1e-5), ("velocity", 2e-4), ("motor_torque", 0.05)]
)
def test_every_other_dead_channel_is_named_too(channel, noise):
    assert ("dead_channel", channel) in kinds(with_channel(channel, noise * RNG.normal(size=N)))


def test_a_speed_that_is_the_rate_of_the_measured_position_is_alive():
    """A joint that stuck where its rig moved: the speed had nothing of the simulation's, and was left out."""
    t = np.arange(N) / 280.0
    position = Channel(t, 0.5 * np.sin(2.0 * t) + 1e-4 * RNG.normal(size=N))
    velocity = Channel(t, np.cos(2.0 * t) + 0.02 * RNG.normal(size=N))
    record = good().with_channels(position=position, velocity=velocity)
    assert "velocity" not in {f.channel for f in dead_channels(record, {}, RIG)}
    noise = record.with_channels(velocity=Channel(t, 0.02 * RNG.normal(size=N)))
    assert "velocity" in {f.channel for f in dead_channels(noise, {}, RIG)}


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_a_sensor_that_freezes_for_long_is_named(share):
    y = good()["ft"].y.copy()
    y[N // 3 : N // 3 + int(share * N)] = y[N // 3]
    assert ("frozen_samples", "ft") in kinds(with_channel("ft", y))


@pytest.mark.parametrize("bench", [QUIET, hide(BENCH, "coulomb_friction", {"torque": 3.0})])
@pytest.mark.parametrize(
    "command",
    [
        np.where(IN_TURNS, COMMAND, 0.0),
        np.where(IN_TURNS, np.abs(COMMAND), 0.0),
        np.where(np.arange(N) > N // 2, COMMAND, 0.0),
        np.where(np.arange(N) < N // 2, COMMAND, 0.0),
        np.clip(COMMAND, -12.0, 12.0),
    ],
    ids=["rests in turns", "one-sided", "rests first", "rests last", "plateaus"],
)
def test_rest_and_plateaus_are_no_faults(bench, command):
    assert kinds(record_command(bench, command, np.random.default_rng(5))) == set()


@pytest.mark.parametrize("level", [0.0, 10.0])
@pytest.mark.parametrize("bench", [BENCH, QUIET])
def test_a_command_that_never_changes_is_one_red_line(bench, level):
    findings = check_record(record_command(bench, np.full(N, level), np.random.default_rng(5)), RIG)
    assert [f.kind for f in findings.findings if f.light == "red"] == ["excitation"]


def test_a_record_in_which_nothing_moves_is_refused_in_one_line():
    record = record_command(BENCH, np.zeros(N), np.random.default_rng(5))
    with pytest.raises(IdentificationError, match="the command stays at 0 N·m and nothing moves"):
        check_diagnosable(record)


@pytest.mark.parametrize("repeats", [1, 15])
def test_a_servo_that_stands_still_is_not_clipped(repeats):
    """It stands most of the time at one of two angles, which are its largest and its smallest."""
    t = np.arange(12_000) / 1000.0
    targets = np.sign(np.sin(2.0 * np.pi * t / 4.0))
    followed = lfilter([0.01], [1.0, -0.99], 0.5 * targets)
    angle = 0.0015 * np.round(np.repeat(followed[::repeats], repeats) / 0.0015)
    assert not clipping(Channel(t, angle), "position").any()
    swing = np.repeat(np.clip(0.8 * np.sin(3.0 * t) + 0.3 * np.sin(7.1 * t), -0.8, 0.8)[::repeats], repeats)
    assert clipping(Channel(t, swing), "position").sum() == np.count_nonzero(np.abs(swing) == 0.8)


def test_where_the_driver_had_a_fault_it_is_named_before_the_dead_sensors():
    """A run that a fault had kept at zero torque was described by its sensors' noise alone."""
    still = {n: Channel(good()[n].t, 1e-3 * RNG.normal(size=N)) for n in good().channels if n != "command"}
    fault = Fault("device_fault", "/rsea/driver", np.nan, "no_reply: 3 cycles")
    record = replace(good().with_channels(**still), faults=(fault,))
    with pytest.raises(IdentificationError, match="driver latched a fault, no_reply: 3 cycles; ") as refused:
        with_check_faults(record, RIG, masks=True)
    assert str(refused.value).count("noise that has nothing to do with the other") == 1
