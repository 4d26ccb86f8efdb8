"""What channels say of each other, span by span: who is wrong, and when; nothing is blamed on a sound one."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel
from rsea_ros.report.check import check_json

RIG = load_rig("paper_high_impedance")
JUDGED = ("sign", "scale", "dead_channel", "frozen_samples", "clock_offset", "contradiction")


@functools.cache
def run():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(2800), 280.0, seed=2)


def late(lag):
    """Return the run with an F/T torque read later than its stamps, by a function of the time, s."""
    ft = run()["ft"]
    return run().with_channels(ft=Channel(ft.t, np.interp(ft.t - lag(ft.t), ft.t, ft.y)))


def said(record, rig=RIG):
    return [f for f in check_record(record, rig).findings if f.light != "green" and f.kind in JUDGED]


def test_a_lag_in_the_second_half_only_is_told_from_when_to_when():
    """It was all green."""
    (finding,) = said(late(lambda t: np.where(t > 5.0, 0.5, 0.0)))
    assert (finding.kind, finding.channel, finding.light) == ("clock_offset", "ft", "red")
    assert finding.value == pytest.approx(0.5, abs=0.01)
    assert "from 5" in finding.detail and "--shift" not in finding.remedy


def test_a_lag_that_grows_is_no_dead_channel():
    """A socket's buffer that fills was a dead channel: check the cable."""
    (finding,) = said(late(lambda t: 0.03 * t))
    assert (finding.kind, finding.channel) == ("clock_offset", "ft")
    assert "growing" in finding.detail


def test_turns_on_two_channels_are_one_factor():
    """The model fitted: stiffness, inertia and damping, each six times off."""
    turns = {n: Channel(run()[n].t, run()[n].y / (2.0 * np.pi)) for n in ("position", "velocity")}
    found = said(run().with_channels(**turns))
    assert [(f.kind, f.channel, f.detail) for f in found] == [
        ("scale", "position", "looks like rev"),
        ("scale", "velocity", "looks like rev/s"),
    ]


@pytest.mark.parametrize(
    "factors",
    [
        {"rotor.reflected_inertia": 8.0, "rotor.reflected_damping": 5.0},
        {"spring.stiffness": 0.2, "rotor.reflected_inertia": 3.0},
        {"spring.stiffness": 6.0, "rotor.reflected_damping": 0.2},
    ],
)
def test_a_stranger_s_rig_convicts_no_channel(factors):
    """Simulated with a rig that does not fit, sound sensors came 0.1 s early or had another clock."""
    rig = RIG.with_values({n: f * RIG[n] for n, f in factors.items()})
    assert said(run(), rig) == []
    assert {f.channel for f in check_record(run(), rig).of("wrong_rig") if f.light != "green"} <= set(factors)


def test_two_channels_alone_show_their_contradiction_and_convict_none():
    velocity = Channel(run()["velocity"].t, 3.4 * run()["velocity"].y)
    two = {n: c for n, c in run().channels.items() if n in ("command", "position")}
    noise = np.random.default_rng(3).standard_normal(len(run()["command"]))
    record = run().with_channels(velocity=velocity, command=Channel(run()["command"].t, noise))
    record = type(record)({n: record[n] for n in (*two, "velocity")})
    (finding,) = (f for f in said(record) if f.kind in ("contradiction", "scale", "sign"))
    assert (finding.kind, finding.light) == ("contradiction", "amber")
    assert finding.value == pytest.approx(3.4, rel=0.1)


def test_the_json_has_every_pair():
    (record,) = json.loads(json.dumps(check_json([check_record(run(), RIG)])))["records"]
    (pair,) = [p for p in record["pairs"] if p["channels"] == ["velocity", "position"]]
    assert pair["factor"] == pytest.approx(1.0, abs=0.1) and pair["sign"] == 1
    assert abs(pair["lag"]) < 0.01 and pair["coherence"] > 0.9
    assert pair["from"] < 0.1 and pair["to"] > 9.9
