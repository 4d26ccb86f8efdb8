"""Sign and scale: an error is reported with its remedy; benches with an effect raise no alarm."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import CATALOGUE, hide
from independent.severities import drawn_parameters

from rsea_ros.checks.check import check_record
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

RIG = load_rig("paper_high_impedance")


@functools.cache
def good():
    return record_run(drawn_bench(np.random.default_rng(2)), 4, duration=12.0)


def scale_channels(record, **factors):
    return record.with_channels(**{n: Channel(record[n].t, f * record[n].y) for n, f in factors.items()})


def red_findings(findings, *kinds):
    return {(f.kind, f.channel) for f in findings.findings if f.light == "red" and f.kind in kinds}


@pytest.mark.parametrize("channel", ["command", "ft", "position", "velocity", "motor_torque"])
def test_a_turned_channel_is_named(channel):
    findings = check_record(scale_channels(good(), **{channel: -1.0}), RIG)
    assert red_findings(findings, "sign", "scale", "wrong_rig") == {("sign", channel)}


@pytest.mark.parametrize(
    ("channel", "factor", "meaning"),
    [
        ("ft", 1e3, "mN m or N mm"),
        ("ft", 1e-3, "kN m"),
        ("command", 1e3, "mN m"),
        ("motor_torque", 1 / 502, "at the motor"),
        ("position", 57.29578, "deg"),
        ("position", 502.0, "rad at the motor"),
        ("position", 1 / 1.2518225e-5, "counts"),
        ("velocity", 57.29578, "deg/s"),
        ("velocity", 9.549297, "rpm"),
        ("velocity", 502 * 9.549297, "rpm at the motor"),
    ],
)
def test_a_unit_is_named_with_its_factor(channel, factor, meaning):
    findings = check_record(scale_channels(good(), **{channel: factor}), RIG)
    assert red_findings(findings, "sign", "scale", "wrong_rig") == {("scale", channel)}
    (result,) = (f for f in findings.of("scale") if f.light == "red")
    assert result.value == pytest.approx(factor, rel=0.01)
    assert meaning in result.detail
    assert ("scale", channel) in {(f.kind, f.channel) for f in findings.faults}


def test_the_remedy_of_a_turned_sensor_is_the_option():
    (result,) = check_record(scale_channels(good(), ft=-1.0), RIG, axis="-torque.z").of("sign")
    assert result.remedy == "--axis torque.z"


def test_drive_values_on_the_motor_side_are_reported_together():
    findings = check_record(scale_channels(good(), command=1 / 502, motor_torque=1 / 502), RIG)
    assert red_findings(findings, "scale") == {("scale", "command"), ("scale", "motor_torque")}


@pytest.mark.parametrize("effect", [None, *CATALOGUE])
def test_an_effect_is_not_taken_for_a_wrong_unit_or_rig(effect):
    rng = np.random.default_rng(1)
    bench = drawn_bench(rng)
    bench = hide(bench, effect, drawn_parameters(effect, "strong", rng)) if effect else bench
    findings = check_record(record_run(bench, 3, duration=8.0), RIG)
    assert findings.light != "red"
    assert not {f.kind for f in findings.faults} & {"sign", "scale", "wrong_rig", "dead_channel"}


def test_an_early_saturation_is_not_taken_for_a_wrong_unit():
    bench = hide(drawn_bench(np.random.default_rng(1)), "torque_saturation", {"limit": 15.0})
    findings = check_record(record_run(bench, 3, "white_noise", 10.0), RIG)
    assert red_findings(findings, "scale", "sign") == set()


def test_a_wrong_inertia_is_not_taken_for_a_scale():
    rig = RIG.with_values({"rotor.reflected_inertia": 2.0 * RIG["rotor.reflected_inertia"]})
    findings = check_record(good(), rig)
    assert findings.light != "red"
    (result,) = (f for f in findings.of("wrong_rig") if f.light != "green")
    assert result.channel == "rotor.reflected_inertia"


@pytest.mark.parametrize(("name", "light"), [("prototype_knee", "amber"), ("cycloidal", "red")])
def test_another_rig_is_asked_about(name, light):
    """In red where pairs measure its values; a simulation that does not fit alone is no more than amber."""
    findings = check_record(good(), load_rig(name))
    assert light in {f.light for f in findings.of("wrong_rig")}
    assert findings.rig_name == name


@pytest.mark.parametrize("samples", [5, 9])
def test_a_moving_average_is_named_with_its_length(samples):
    """It was reported as `177 times the noise`."""
    y = np.convolve(good()["ft"].y, np.ones(samples) / samples)[: len(good()["ft"])]
    findings = check_record(good().with_channels(ft=Channel(good()["ft"].t, y)), RIG)
    (result,) = findings.of("smoothing")
    assert result.value == pytest.approx(1e3 * samples / 280.0, rel=1e-3)
    assert f"average of {samples} samples" in result.detail
    assert "smoothing" in {f.kind for f in findings.faults}


@pytest.mark.parametrize("samples", [3, 5])
def test_a_centred_average_has_no_lag_and_is_named_too(samples):
    """Smoothed after the run: 63 times the noise in a diagnosis, and no word of it."""
    y = np.convolve(good()["ft"].y, np.ones(samples) / samples, "same")
    (smoothed,) = check_record(good().with_channels(ft=Channel(good()["ft"].t, y)), RIG).of("smoothing")
    assert smoothed.value == pytest.approx(1e3 * samples / 280.0, rel=1e-3)
    assert f"centred moving average of {samples} samples" in smoothed.detail


@pytest.mark.parametrize("centred", [False, True])
@pytest.mark.parametrize("samples", [5, 9])
@pytest.mark.parametrize("names", [("position",), ("velocity",), ("position", "velocity")])
def test_an_averaged_joint_is_named_as_the_f_t_sensor_is(names, samples, centred):
    """Only the F/T channel was tried: an averaged encoder gave a stiffness without a word of why."""
    window, before = np.ones(samples) / samples, samples // 2 if centred else samples - 1
    averaged = {
        n: Channel(c.t, np.convolve(np.pad(c.y, (before, samples - 1 - before), "edge"), window, "valid"))
        for n in names
        for c in [good()[n]]
    }
    findings = check_record(good().with_channels(**averaged), RIG)
    assert {f.channel for f in findings.of("smoothing")} == set(names)
    assert all(f"average of {samples} samples" in f.detail for f in findings.of("smoothing"))


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [("ft_sensor_lag", {"time_constant": 5e-3}), ("command_delay", {"delay": 8e-3}), (None, {})],
)
def test_a_lag_of_sensor_or_drive_is_not_taken_for_a_moving_average(effect, parameters):
    bench = drawn_bench(np.random.default_rng(1))
    bench = hide(bench, effect, parameters) if effect else bench
    assert check_record(record_run(bench, 3, duration=8.0), RIG).of("smoothing") == ()


def test_where_no_two_channels_agree_nothing_is_convicted_and_the_contradictions_are_shown():
    record = scale_channels(good(), command=1e3, position=57.29578, velocity=9.549297)
    record = record.with_channels(motor_torque=record["command"])
    findings = check_record(record, RIG)
    assert red_findings(findings, "sign", "scale", "wrong_rig") == set()
    assert {f.channel for f in findings.of("contradiction")} >= {"velocity", "command"}


@pytest.mark.parametrize("channel", ["command", "motor_torque"])
def test_amperes_are_reported_with_the_measured_factor_not_that_of_a_unit_near_it(channel):
    findings = check_record(scale_channels(good(), **{channel: 1 / 6.826}), RIG)
    (result,) = (f for f in findings.of("scale") if f.light == "red")
    assert result.channel == channel
    assert result.value == pytest.approx(1 / 6.826, rel=0.1)
    assert "no unit" in result.detail
    assert float(result.remedy.split()[1].rstrip("`")) == pytest.approx(6.826, rel=0.1)


def test_commands_in_the_place_of_the_ft_torque_contradict_the_position():
    record = good()
    same = record.with_channels(ft=Channel(record["command"].t, record["command"].y))
    findings = check_record(same, RIG)
    assert {f.channel for f in findings.of("contradiction")} == {"ft"}
    assert red_findings(findings, "sign", "scale", "wrong_rig") == set()
