"""Findings on single signals at their limits: band, rest, noise, standstill, offsets and jumps."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.checks.expected import Side
from rsea_ros.checks.signal_findings import (
    angle_offset_findings,
    excitation,
    jump_findings,
    noises,
    offset_findings,
    standstill_findings,
)
from rsea_ros.identification.excitation import ExcitationSettings, excitation as drawn
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RIG = load_rig("paper_high_impedance")
RATE = 200.0
T = np.arange(2000) / RATE
NATURAL = math.sqrt(1530.456 / 0.957) / (2.0 * math.pi)
"""Hz: spring on rotor and chassis, 6.36."""


def record(**channels):
    return Record({name: Channel(T, np.asarray(y, float)) for name, y in channels.items()})


def sine(hz, size=1.0):
    return size * np.sin(2.0 * np.pi * hz * T)


@functools.cache
def run():
    """Return 8 s of the paper's bench at 280 Hz under noise."""
    u = drawn("white_noise", ExcitationSettings(rate=280.0, duration=8.0, seed=1))
    return synthesize(RIG, Channel(np.arange(len(u)) / 280.0, u))


def moved(name, by):
    """Return the run with a channel moved by a number, or by numbers at its samples."""
    return run().with_channels(**{name: Channel(run()[name].t, run()[name].y + by)})


def lights(findings, kind):
    return [(f.channel, f.light) for f in findings.of(kind) if f.light != "green"]


@pytest.mark.parametrize(
    ("command", "light", "detail"),
    [(sine(2.0, 10.0), "amber", "2 to 2 Hz, peak 10 N·m"),
     (sine(3.1, 5.0), "amber", "3.1 to 3.1 Hz, peak 5 N·m"),
     (sine(3.3, 5.0), "green", "3.3 to 3.3 Hz, peak 5 N·m")],
)  # fmt: skip
def test_a_command_excites_from_half_the_natural_frequency_on(command, light, detail):
    found, *_ = excitation(record(command=command), RIG)
    assert (found.light, found.kind, found.channel, found.unit) == (light, "excitation", "command", "N m")
    assert found.detail == detail and found.value == pytest.approx(np.max(command) / math.sqrt(2.0), rel=1e-3)
    assert found.expected == (f"a band beyond {NATURAL:.3g} Hz" if light == "amber" else "")
    (constant,) = excitation(record(command=np.full(len(T), 3.0)), RIG)
    assert (constant.light, constant.value, constant.detail) == ("red", 3.0, "the command never changes")


@pytest.mark.parametrize(
    ("share", "light"), [(0.01, None), (0.03, "green"), (0.45, "green"), (0.55, "amber")]
)
def test_rest_is_told_from_two_percent_on_and_too_much_beyond_half(share, light):
    moving = np.where(10.0 * share <= T, (-1.0) ** np.arange(len(T)), 0.0)
    found = [f for f in excitation(record(command=moving, ft=moving), RIG) if f.kind == "rest"]
    assert [f.light for f in found] == ([light] if light else [])
    for f in found:
        assert f.value == pytest.approx(100.0 * share, abs=1.5) and f.unit == "%"
        assert f.expected == "less than 50 %"
        assert f.remedy == ("cut it with --from and --to" if share > 0.5 else "")


@pytest.mark.parametrize(
    ("times", "light", "words"),
    [(0.5, "green", "0.5 times the rig's"), (1.5, "green", "1.5 times the rig's"),
     (4.0, "green", "at most 4 times the rig's: the motion may be as rough"),
     (13.0, "amber", "13 times the rig's")],
)  # fmt: skip
def test_the_noise_of_a_sensor_is_beside_that_of_its_rig(times, light, words):
    white = np.random.default_rng(3).standard_normal(len(T))
    (found,) = noises(record(command=sine(3.0), ft=times * 0.03 * white), RIG)
    assert (found.light, found.kind, found.channel, found.expected) == (light, "noise", "ft", "about 0.03")
    assert found.value == pytest.approx(times * 0.03, rel=0.08)
    number, *rest = found.detail.removeprefix("at most ").split(" ", 1)
    assert float(number) == pytest.approx(times, rel=0.08) and words.endswith(rest[0])
    assert found.detail.startswith("at most") == words.startswith("at most")
    assert not list(noises(record(command=sine(3.0), ft=white), RIG, but={"ft"}))
    assert not list(noises(record(ft=white), RIG))


@pytest.mark.parametrize(("first", "last", "told"), [(4.0, 6.5, True), (4.0, 4.9, False), (0.0, 3.0, True)])
def test_a_standstill_under_a_command_is_told_from_a_second_on(first, last, told):
    angle = sine(1.5)
    angle[(first <= T) & (last > T)] = angle[int(first * RATE)]
    angle += 1e-3 * np.random.default_rng(2).standard_normal(len(T))
    found = list(standstill_findings(record(command=sine(1.5), position=angle)))
    assert bool(found) == told
    for f in found:
        assert f.light == "amber" and f.value == pytest.approx(last - first, abs=0.25)
    resting = np.where((first <= T) & (last > T), 1.0, sine(1.5))
    assert not list(standstill_findings(record(command=resting, position=angle)))


def test_a_motor_that_is_off_for_a_while_is_said():
    rng = np.random.default_rng(0)
    off = {}
    for name in ("position", "velocity", "ft"):
        t, y = run()[name].t, run()[name].y
        off[name] = Channel(t, np.where(t > 5.0, RIG.sensors[name].noise * rng.standard_normal(len(t)), y))
    (still,) = check_record(run().with_channels(**off), RIG).of("standstill")
    assert still.value == pytest.approx(3.0, abs=0.25)
    assert list(standstill_findings(run())) == []


def test_a_sensor_that_is_not_recorded_then_does_not_stand_still():
    short = Record({"command": run()["command"], "ft": run()["ft"].between(0.0, 2.0)})
    assert list(standstill_findings(short)) == []
    slow = {n: Channel(c.t[9::10], c.y[9::10]) for n, c in run().channels.items() if n != "command"}
    assert list(standstill_findings(Record({"command": run()["command"], **slow}))) == []


@pytest.mark.parametrize(
    ("offset", "light"), [(9.9, None), (10.1, "amber"), (-29.9, "amber"), (30.1, "red"), (-30.1, "red")]
)
def test_an_offset_of_ft_is_over_the_largest_torque_of_the_run(offset, light):
    """The command reaches 10 N·m, the prediction 4."""
    run, predicted = record(command=sine(1.0, 10.0)), sine(1.0, 4.0)
    found = list(offset_findings(run, {"ft": Side(T, predicted + offset, predicted)}))
    assert [f.light for f in found] == ([light] if light else [])
    for f in found:
        assert f.value == pytest.approx(offset) and f.detail.startswith(f"{abs(offset) / 10.0:.2g} times")
    assert not list(offset_findings(run, {}))


@pytest.mark.parametrize(
    ("offset", "told"), [(5.0, []), (-90.0, [("ft", "amber")]), (300.0, [("ft", "red")])]
)
def test_an_offset_of_ft_that_no_torque_explains_is_a_fault_of_the_record(offset, told):
    findings = check_record(moved("ft", offset), RIG)
    assert lights(findings, "offset") == told
    assert [f.value for f in findings.of("offset")] == pytest.approx([offset] * len(told), abs=2.0)
    assert [f.channel for f in findings.faults if f.kind == "offset"] == ["ft"] * len(told)


@pytest.mark.parametrize(("middle", "rest", "told"), [(0.4, 0.0, False), (0.6, 0.0, True), (0.6, 0.3, False)])
def test_an_angle_lies_elsewhere_where_all_of_its_range_does(middle, rest, told):
    side = Side(T, middle + sine(1.0, 0.25), rest + sine(1.0, 0.25))
    found = list(angle_offset_findings(RIG, {"position": side}))
    assert [f.value for f in found] == pytest.approx([middle - rest] * told, abs=1e-9)


@pytest.mark.parametrize("zero", [0.0, 100.0, -0.5])
def test_an_angle_whose_zero_is_elsewhere_is_told_from_a_wrong_rig(zero):
    """A count of turns in the position made the whole simulation wild: three sensors of a wrong rig."""
    findings = check_record(moved("position", zero), RIG)
    assert lights(findings, "offset") == [("position", "red")] * (zero != 0.0)
    assert lights(findings, "wrong_rig") == []
    unknown = replace(RIG.sensors["position"], zero_unknown=True)
    knowing = replace(RIG, sensors={**RIG.sensors, "position": unknown})
    assert check_record(moved("position", zero), knowing).of("offset") == ()


def test_a_fit_compares_the_changes_of_an_angle_whose_zero_is_elsewhere():
    """15976725 times the noise, beside a line that said what is wrong."""
    fit = rsea.identify(moved("position", 100.0), RIG)
    assert max(fit.result.times_noise.values()) < 1.2
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=2.0)


@pytest.mark.parametrize(
    ("jump", "told"),
    [(2.0 * math.pi, "6.28 rad at 5 s: a whole turn"), (-2.0 * math.pi, "-6.28 rad at 5 s: a whole turn"),
     (1.5, "1.5 rad at 5 s: the velocity did not make it"), (0.01, "")],
)  # fmt: skip
def test_an_angle_that_jumps_by_a_turn_or_without_a_velocity_is_told(jump, told):
    angle = sine(0.5, 0.1) + jump * (T >= 5.0 - 1e-9)
    velocity = 0.1 * np.pi * np.cos(np.pi * T)
    found = jump_findings(record(position=angle, velocity=velocity))
    assert [f.detail for f in found] == ([f"by {told}"] if told else [])
    assert not jump_findings(record(deflection=angle)) or "turn" in told
    made = velocity + np.where(np.abs(T - 5.0) < 0.011, jump * RATE, 0.0)
    assert bool(jump_findings(record(position=angle, velocity=made))) == ("turn" in told)


@pytest.mark.parametrize("names", [("position", "velocity"), ("position",)])
def test_a_wrapped_angle_is_named_with_what_unwraps_it(names):
    swing = 3.0 + 2.0 * sine(1.0 / np.pi)
    made = {"position": (swing + np.pi) % (2.0 * np.pi) - np.pi, "velocity": np.gradient(swing, T)}
    (jumps,) = jump_findings(record(command=sine(3.0), **{name: made[name] for name in names}))
    crossings = np.count_nonzero(np.diff(np.sign(np.sin(0.5 * (swing - np.pi)))))
    assert (jumps.light, jumps.value) == ("red", crossings)
    assert "a whole turn" in jumps.detail and "unwrap" in jumps.remedy


def test_an_encoder_that_counts_anew_is_a_fault_of_the_record():
    findings = check_record(moved("position", 0.3 * (run()["position"].t > 5.0)), RIG)
    (jumps,) = findings.of("angle_jumps")
    assert "by 0.3" in jumps.detail and "at 5.00" in jumps.detail
    assert "angle_jumps" in {f.kind for f in findings.faults}


@pytest.mark.parametrize("rate", [280.0, 10.0, 5.0])
def test_a_motion_in_steps_is_no_jump(rate):
    stamps = np.arange(0.0, 8.0, 1.0 / rate)
    steps = 0.5 * np.sign(np.sin(0.7 * stamps))
    followed = Channel(stamps, steps * (1.0 - np.exp(-30.0 * (0.1 + np.abs(np.sin(0.7 * stamps))))))
    assert jump_findings(Record({"position": followed, "command": Channel(stamps, steps)})) == []
    assert jump_findings(run()) == []
