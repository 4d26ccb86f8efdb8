"""A rig without the machine's spring, or with another inertia, is questioned in red."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.checks.rig_findings import restoring_findings
from rsea_ros.checks.verdicts import RIGHT_RIG
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

RATE = 280.0


def run_of(name, amplitude):
    return rsea.simulate(name, amplitude * np.random.default_rng(4).standard_normal(2800), RATE, seed=4)


def lights_of(findings):
    return {f.channel: f.light for f in findings.of("wrong_rig") if f.light != "green"}


@pytest.mark.parametrize("rig", ["bare_drive", "pendulum"])
def test_a_rig_without_a_spring_is_questioned_on_a_bench_with_one(rig):
    """This check was green."""
    record = record_run(drawn_bench(np.random.default_rng(2)), 4, duration=10.0)
    findings = check_record(record, load_rig(rig))
    (finding,) = (f for f in findings.of("wrong_rig") if f.channel == "spring_end.stiffness")
    assert finding.light == "red"
    assert finding.value == pytest.approx(1530.0, rel=0.1)
    assert finding.remedy == RIGHT_RIG


def test_a_rig_without_gravity_is_questioned_on_a_pendulum_that_swings_far():
    """Its torque follows sin(q), which no frequency response shows; a real pendulum was rated amber."""
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    q = 2.0 * np.sin(1.7 * t) * np.sin(0.31 * t)
    v = np.gradient(q, t)
    torque = 0.15 * np.gradient(v, t) + 0.05 * v + 3.0 * np.sin(q)
    record = Record({"command": Channel(t, torque), "position": Channel(t, q)}, "swing")
    assert [f.light for f in restoring_findings(record, load_rig("bare_drive"))] == ["red"]
    assert list(restoring_findings(record, load_rig("pendulum"))) == []


@pytest.mark.parametrize(("name", "amplitude"), [("bare_drive", 15.0), ("pendulum", 1.0)])
def test_the_right_rig_is_not_questioned(name, amplitude):
    assert lights_of(check_record(run_of(name, amplitude), load_rig(name))) == {}


@pytest.mark.parametrize(("factor", "light"), [(0.144, {}), (0.02, {"spring_end.inertia": "red"})])
def test_a_drive_within_the_coarse_spread_of_its_rig_is_not_questioned(factor, light):
    """A rig that states its inertia to 100 % was the wrong one in red at a seventh of it."""
    rig = load_rig("emps")
    values = {n: factor * rig[n] for n in ("rotor.reflected_inertia", "rotor.reflected_damping")}
    command = 50.0 * np.random.default_rng(4).standard_normal(2800)
    run = rsea.simulate(rig.with_values(values), command, RATE, seed=4)
    assert lights_of(check_record(run, rig)) == light


def test_a_value_that_identify_leaves_to_the_prior_is_undetermined():
    """Without encoder three values have no unique size: the check called them determined."""
    run = run_of("paper_high_impedance", 15.0)
    run = replace(run, channels={n: run[n] for n in ("command", "ft")})
    fit = rsea.identify(run, "paper_high_impedance")
    left = {p.name for p in fit.result.parameters if p.determined == "no" and not p.name.startswith("clock")}
    finding = rsea.check(run, "paper_high_impedance").result.of("identifiability")
    assert {f.channel for f in finding if f.light == "amber"} == left
    assert {"rotor.reflected_inertia", "rotor.reflected_damping", "spring.damping"} <= left


def test_a_value_far_from_the_rigs_is_amber_with_both_numbers():
    """A spring 30 % off was green."""
    bench = load_rig("paper_high_impedance").with_values({"spring.stiffness": 1.3 * 1530.456})
    run = rsea.simulate(bench, 15.0 * np.random.default_rng(4).standard_normal(2800), RATE, seed=4)
    (finding,) = rsea.check(run, "paper_high_impedance").result.of("rig_value")
    assert (finding.light, finding.channel, finding.expected) == (
        "amber",
        "spring.stiffness",
        "1530, to 15 %",
    )
    assert finding.low < 1.3 * 1530.456 < finding.high
    assert rsea.check(run, bench).result.of("rig_value") == ()
