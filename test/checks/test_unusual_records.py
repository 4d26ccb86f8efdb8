"""Unusual records: few samples, none, a tiny command, rounded stamps, shared gaps, held values."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros import simulate
from rsea_ros.checks.check import check_record
from rsea_ros.checks.expected import is_still
from rsea_ros.checks.linearised_rig import linear_of
from rsea_ros.checks.stamp_findings import rounded_stamps
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.result import statics_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record
from rsea_ros.records.stamps import repair_stamps

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


@pytest.fixture(scope="module")
def record():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(1400), 280.0)


def first(record, name, count):
    channel = record[name]
    return record.with_channels(**{name: Channel(channel.t[:count], channel.y[:count])})


@pytest.mark.parametrize(
    ("name", "count", "kind"),
    [("ft", 1, "missing_topic"), ("position", 20, "partly_recorded")],
)
def test_a_channel_of_a_few_samples_is_reported_and_left_out_of_the_fit(record, name, count, kind):
    """One sample was a bug of rsea in every verb, up to nine were not reported, up to 31 refused the rest."""
    short = first(record, name, count)
    assert (kind, name) in {(f.kind, f.channel) for f in check_record(short, RIG).faults}
    fit = rsea.identify(short, RIG)
    assert fit.verdict == "adequate" and name not in fit.result.residual_rms
    assert (kind, name) in {(f.kind, f.channel) for f in fit.result.faults}


def test_gaps_of_all_channels_are_no_jump_of_the_clocks_of_some(record):
    """Sensors that end a gap later than the commands lost their first gap: 26 times the noise."""
    bursts = {n: np.mod(c.t, 1.0) < 0.5 for n, c in record.channels.items()}
    assert record["ft"].t[-1] - record["command"].t[bursts["command"]][-1] > 0.5
    cut = record.with_channels(**{n: Channel(record[n].t[on], record[n].y[on]) for n, on in bursts.items()})
    repaired, faults = repair_stamps(cut)
    assert "clock_jump" not in {f.kind for f in faults}
    for name, channel in cut.channels.items():
        np.testing.assert_array_equal(repaired[name].t, channel.t)


def test_a_sensor_that_ends_early_in_a_long_record_still_takes_part_in_its_checks():
    """The checks look at the 30 s of the largest commands: without a sample of it they ended in a bug."""
    command = np.linspace(5.0, 15.0, 70 * 280) * np.random.default_rng(1).standard_normal(70 * 280)
    long = rsea.simulate(RIG, command, 280.0)
    findings = check_record(first(long, "ft", 35 * 280), RIG, values=True)
    assert {f.kind for f in findings.findings if f.light != "green"} == {"partly_recorded"}
    assert ("clock_drift", "ft") in {(f.kind, f.channel) for f in findings.findings}
    assert check_record(first(long, "ft", 10 * 280), RIG, values=True).light == "amber"


def channel(rate, step, start=0.0, size=2101, missing=()):
    t = start + np.delete(np.arange(size), missing) / rate
    return Channel(step * np.round(t / step) if step else t, np.zeros(len(t)))


@pytest.mark.parametrize(
    ("rate", "step", "says"),
    [
        (280.0, 1e-3, "whole ms, off by up to 0.5 ms at 280"),
        (60.0, 1e-2, "whole multiples of 10 ms, off by up to 5 ms at "),
        (1920.0, 1e-4, "whole multiples of 100 µs, off by up to 0.05 ms at 1920"),
    ],
)
@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_rounding_is_reported_with_step_and_rate(rate, step, says, start):
    (fault,) = rounded_stamps(channel(rate, step, start), "ft")
    assert (fault.kind, fault.channel) == ("rounded_stamps", "ft") and fault.detail.startswith(says)


@pytest.mark.parametrize(
    "sound",
    [
        channel(1000.0, 1e-3),
        channel(250.0, 1e-3, missing=(7, 900, 901)),
        channel(100.0, 0.0, missing=np.random.default_rng(3).choice(2101, 210, replace=False)),
        channel(280.0, 1e-6),
        channel(280.0, 0.0, 1.7e9),
        channel(280.0, 1e-3, size=8),
    ],
)
def test_stamps_that_lose_nothing_by_rounding_are_sound(sound):
    assert rounded_stamps(sound, "ft") == []


@pytest.fixture(scope="module")
def rounded(record):
    return record.with_channels(**{n: Channel(np.round(c.t, 3), c.y) for n, c in record.channels.items()})


def test_the_check_is_amber_and_names_the_rate_of_the_samples(rounded):
    """It was green, at 250 Hz: the median of intervals of 3 and 4 ms."""
    findings = check_record(rounded, RIG)
    assert {(f.light, f.channel) for f in findings.of("rounded_stamps")} == {
        ("amber", n) for n in rounded.channels
    }
    assert [f.value for f in findings.of("rate")] == pytest.approx([280.0] * len(rounded.channels), rel=1e-3)
