"""Stamps of another clock: an offset of seconds is a number, not another rig or a dead sensor."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.checks.check import check_record
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

RIG = load_rig("paper_high_impedance")


@functools.cache
def good():
    record = record_run(drawn_bench(np.random.default_rng(2)), 4, duration=10.0)
    return record.with_channels(**{n: Channel(c.t + 10.0, c.y) for n, c in record.channels.items()})


def shift_stamps(seconds, *names):
    return good().with_channels(**{n: Channel(good()[n].t + seconds, good()[n].y) for n in names})


def off(findings):
    return {f.channel: f.value for f in findings.of("clock_offset") if f.light == "red"}


@pytest.mark.parametrize("seconds", [-0.5, 1.7])
def test_commands_on_another_clock_are_not_taken_for_another_rig(seconds):
    """They were called a wrong rig; clocks were not mentioned."""
    findings = check_record(shift_stamps(seconds, "command"), RIG)
    assert off(findings) == {"command": pytest.approx(seconds, abs=0.005)}
    assert {f.kind for f in findings.findings if f.light == "red"} == {"clock_offset"}
    assert "clock_offset" in {f.kind for f in findings.faults}


def test_a_sensor_on_another_clock_is_not_taken_for_dead_or_for_another_rig():
    findings = check_record(shift_stamps(-1.8, "ft"), RIG)
    assert off(findings) == {"ft": pytest.approx(-1.8, abs=0.01)}
    assert {f.kind for f in findings.findings if f.light == "red"} == {"clock_offset"}


def test_a_lag_is_not_read_from_a_sine_that_fits_many():
    t = good()["command"].t
    sine = Channel(t, 20.0 * np.sin(2.0 * np.pi * 3.0 * t))
    assert off(check_record(good().with_channels(command=sine), RIG)) == {}


def test_the_suggested_option_corrects_the_clock(tmp_path, capsys):
    bag = str(tmp_path / "bag.mcap")
    write_record(shift_stamps(-0.5, "command"), bag)
    assert main(["check", bag, "--json", "--fail-on", "red"]) == 1
    (record,) = json.loads(capsys.readouterr().out)["records"]
    (clock,) = (f for f in record["findings"] if f["kind"] == "clock_offset" and f["light"] == "red")
    assert "--shift command=0.5" in clock["remedy"]
    assert main(["check", bag, "--shift", "command=0.5", "--fail-on", "amber"]) == 0


@pytest.mark.parametrize("shift", ["command", "command=x", "torque=0.5", "command=nan"])
def test_a_shift_of_nothing_is_refused_in_one_line(shift, tmp_path, capsys):
    bag = str(tmp_path / "bag.mcap")
    write_record(good(), bag)
    assert main(["check", bag, "--shift", shift]) == 2
    assert f"--shift {shift}: expected CHANNEL=S" in capsys.readouterr().err


@functools.cache
def simulate(seconds):
    command = 10.0 * np.random.default_rng(3).standard_normal(int(280 * seconds))
    return rsea.simulate(RIG, command, 280.0, seed=3)


def slow(record, hz, seconds, *names):
    """Return the record with every n-th sample of some channels, stamped later by some seconds."""
    n = round(280 / hz)
    return record.with_channels(
        **{c: Channel(record[c].t[n - 1 :: n] + seconds, record[c].y[n - 1 :: n]) for c in names}
    )


@pytest.mark.parametrize("seconds", [-1.0, -0.73])
@pytest.mark.parametrize("hz", [1, 2.5, 10])
@pytest.mark.parametrize("name", ["motor_torque", "ft"])
def test_the_clock_of_a_slow_channel_is_a_number_too(name, hz, seconds):
    """At 1 Hz there were too few samples for a word; 0.73 s at 10 Hz was a dead channel."""
    findings = check_record(slow(simulate(90.0), hz, seconds, name), RIG)
    assert off(findings) == {name: pytest.approx(seconds, abs=0.008)}
    assert not findings.of("dead_channel")


@pytest.mark.parametrize("seconds", [-1.0, 0.0])
def test_a_clock_that_few_samples_leave_open_is_said_to_be_open(seconds):
    findings = check_record(slow(simulate(12.0), 1, seconds, "motor_torque"), RIG)
    (clock,) = (f for f in findings.of("clock_offset") if f.channel == "motor_torque")
    assert clock.value is None and "not determined" in clock.detail


def test_a_slow_channel_in_time_has_no_offset():
    assert off(check_record(slow(simulate(90.0), 2.5, 0.0, "ft", "motor_torque"), RIG)) == {}
