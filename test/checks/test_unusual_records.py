"""Unusual records: few samples, none, a tiny command."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros import simulate
from rsea_ros.checks.check import check_record
from rsea_ros.checks.expected import is_still
from rsea_ros.checks.linearised_rig import linear_of
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.result import statics_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

RIG = load_rig("paper_high_impedance")
T = np.arange(2000) / 280.0


def check_command(command, size=2000):
    noise = np.random.default_rng(0).normal(size=(2, len(T)))[:, :size]
    channels = {"ft": Channel(T[:size], noise[0]), "position": Channel(T[:size], noise[1])}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return check_record(Record({"command": Channel(T[: len(command)], command), **channels}), RIG)


@pytest.mark.parametrize("size", [0, 1, 2, 3, 10, 64, 80])
def test_few_samples_are_checked_without_a_warning(size):
    assert {f.kind for f in check_command(np.sin(T[:size]), size).findings} >= {"topics", "missing_topic"}


LAST = np.arange(len(T)) == len(T) - 1
COMMANDS = {
    "of 1e-300": (1e-300 * np.sin(T), "red"),
    "of one sample": (np.where(LAST, 1.0, 0.0), "green"),
    "with 1e308": (np.where(LAST, 1e308, np.sin(T)), "amber"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_tiny_and_excessive_commands_are_rated(name):
    command, light = COMMANDS[name]
    assert [f.light for f in check_command(command).findings if f.kind == "excitation"] == [light]


def test_a_sensor_of_too_few_samples_is_left_out_of_the_clocks():
    t = np.arange(450) / 5.0
    rng = np.random.default_rng(0)
    channels = {"command": Channel(t, 5.0 * rng.normal(size=450)), "ft": Channel(t, rng.normal(size=450))}
    record = Record({**channels, "velocity": Channel(t[:300:5], rng.normal(size=60))})
    rig = load_rig("cycloidal")
    shape = SimpleNamespace(values={}, delay={})
    assert set(linear_of(record, {}, rig, shape).offset) == {"ft"}


def test_a_sensor_whose_every_sample_is_masked_is_left_out_of_the_clocks():
    """Its misfit was the mean of nothing: a warning."""
    run = simulate(RIG, 15.0 * np.random.default_rng(0).standard_normal(len(T)), 280.0)
    shape, all_of = SimpleNamespace(values={}, delay={}), np.ones(len(T), bool)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "ft" not in linear_of(run, {"ft": all_of}, RIG, shape).offset
    with pytest.raises(IdentificationError, match="no sample of"):
        linear_of(run, dict.fromkeys(("ft", "position", "velocity"), all_of), RIG, shape)


@pytest.mark.parametrize("dead", [1e300, -1e308])
def test_a_sensor_of_excessive_readings_is_still_without_a_warning(dead):
    """Their squares are infinite, and the check before every verb warned of it."""
    readings = {"position": np.full(len(T), dead), "ft": dead * np.where(np.arange(len(T)) % 2, 1.0, 0.9)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert is_still(Record({n: Channel(T, y) for n, y in readings.items()}))


def test_another_axis_is_tried_on_stamps_put_right():
    """Stamps that come twice have a median interval of zero, and the grid between them had no end."""
    command = Channel(T, np.random.default_rng(3).normal(size=len(T)))
    twice = np.repeat(T[::2], 2)
    dead, alive = Channel(twice, np.zeros(len(T))), Channel(twice, np.roll(command.y, 2))
    position = Channel(T, np.cumsum(command.y))
    record = Record({"command": command, "position": position, "ft": dead})
    said = check_record(record, RIG, wrench=lambda: {"torque.x": alive})
    assert {f.kind for f in said.findings if f.channel == "ft"} >= {"dead_channel", "duplicate_stamps"}


def test_a_log_faster_than_its_sensors_is_noticed():
    """Every light was green for a log at 1 kHz in which a new reading came every 15 ms."""
    t = np.arange(3000) / 1000.0
    run = simulate(RIG, 20.0 * np.sin(12.0 * t), rate=1000.0)
    slow = np.arange(len(run["ft"])) // 15 * 15
    record = run.with_channels(ft=Channel(run["ft"].t, run["ft"].y[slow]))
    (held,) = [f for f in check_record(record, RIG).findings if f.kind == "held_samples"]
    assert (held.channel, held.light, held.value) == ("ft", "amber", pytest.approx(1000.0 / 15.0))


def test_the_repeats_of_a_slow_sensor_are_left_out_of_a_fit():
    """Sensors at 40 Hz in a log at 280 Hz gave K_s 1820 ± 160 N m/rad and a clock drift of -95 ppm."""
    u = 15.0 * np.random.default_rng(1).standard_normal(2800)
    sound = simulate(RIG, u, rate=280.0)
    slow = np.arange(len(sound["ft"])) // 7 * 7
    names = ("ft", "position", "velocity")
    record = sound.with_channels(**{n: Channel(sound[n].t, sound[n].y[slow]) for n in names})
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.1
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=2.0)
    assert {f.kind for f in fit.result.faults} == {"held_samples"}


def test_a_diagnosis_of_a_constant_command_says_that_it_could_see_nothing():
    """`Nothing is wrong with the simulation` of a bench that was never moved."""
    record = simulate(RIG, np.full(2800, 4.0), rate=280.0)
    dx = rsea.diagnose(record, RIG)
    assert dx.sentence.startswith("These data show nothing: the command never changes")
    assert dx.summary().startswith("These data show nothing")


def test_statics_need_an_angle_that_grows_with_the_load():
    """At 1 Hz `Static stiffness inf N m/rad` stood beside red rates."""
    t = np.arange(60.0)
    command = Channel(t, 15.0 * np.sin(0.3 * t))
    position = Channel(t, 1e-3 * np.random.default_rng(0).standard_normal(60) - 1e-3 * command.y)
    assert statics_of(Record({"command": command, "position": position}), RIG) is None
