"""Angles that wrap or are counted anew, and machines that stand still under a command, are said."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from rsea_ros.checks.check import check_record
from rsea_ros.checks.signal_findings import jump_findings, standstill_findings
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RIG = load_rig("paper_high_impedance")
U = excitation("white_noise", ExcitationSettings(rate=280.0, duration=8.0, seed=1))
T = np.arange(len(U)) / 280.0


@functools.cache
def run():
    return synthesize(RIG, Channel(T, U))


def turn_joint(angle, **others):
    rate = Channel(T, np.gradient(angle, T))
    return Record({"command": Channel(T, U), "position": Channel(T, angle), "velocity": rate, **others})


@pytest.mark.parametrize("with_velocity", [True, False])
def test_a_wrapped_angle_is_named_with_what_unwraps_it(with_velocity):
    swing = 3.0 + 2.0 * np.sin(2.0 * T)
    record = turn_joint(swing).with_channels(position=Channel(T, (swing + np.pi) % (2.0 * np.pi) - np.pi))
    if not with_velocity:
        record = Record({n: record[n] for n in ("command", "position")})
    (jumps,) = jump_findings(record)
    crossings = np.count_nonzero(np.diff(np.sign(np.sin(0.5 * (swing - np.pi)))))
    assert (jumps.light, jumps.value) == ("red", crossings)
    assert "a whole turn" in jumps.detail and "unwrap" in jumps.remedy


def test_an_encoder_that_counts_anew_is_named_with_the_time():
    position = run()["position"]
    anew = Channel(position.t, np.where(position.t > 5.0, position.y + 0.3, position.y))
    findings = check_record(run().with_channels(position=anew), RIG)
    (jumps,) = findings.of("angle_jumps")
    assert "by 0.3" in jumps.detail and "at 5.00" in jumps.detail
    assert "angle_jumps" in {f.kind for f in findings.faults}


@pytest.mark.parametrize("rate", [280, 10, 5])
def test_a_motion_in_steps_is_no_jump(rate):
    stamps = T[:: 280 // rate]
    steps = 0.5 * np.sign(np.sin(0.7 * stamps))
    followed = Channel(stamps, steps * (1.0 - np.exp(-30.0 * (0.1 + np.abs(np.sin(0.7 * stamps))))))
    assert jump_findings(Record({"position": followed, "command": Channel(stamps, steps)})) == []
    assert jump_findings(run()) == []


@pytest.mark.parametrize("start", [2.0, 5.0])
def test_a_motor_that_is_off_for_a_while_is_said(start):
    rng = np.random.default_rng(0)
    off = {}
    for name in ("position", "velocity", "ft"):
        t, noise = run()[name].t, RIG.sensors[name].noise * rng.standard_normal(len(T))
        off[name] = Channel(t, np.where(t > start, noise, run()[name].y))
    (jumps,) = check_record(run().with_channels(**off), RIG).of("standstill")
    assert jumps.value == pytest.approx(8.0 - start, abs=0.25)
    assert list(standstill_findings(run())) == []


def test_a_sensor_that_is_not_recorded_then_does_not_stand_still():
    short = Record({"command": run()["command"], "ft": run()["ft"].between(0.0, 2.0)})
    assert list(standstill_findings(short)) == []
    slow = {n: Channel(c.t[9::10], c.y[9::10]) for n, c in run().channels.items() if n != "command"}
    assert list(standstill_findings(Record({"command": run()["command"], **slow}))) == []
