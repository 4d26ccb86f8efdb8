"""Channels of a few samples and stamps rounded to whole ms are reported; shared gaps are no clock jumps."""

from __future__ import annotations

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.checks.stamp_findings import rounded_stamps
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel
from rsea_ros.records.stamps import repair_stamps

RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def record():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(1400), 280.0)


def first(record, name, count):
    channel = record[name]
    return record.with_channels(**{name: Channel(channel.t[:count], channel.y[:count])})


@pytest.mark.parametrize(
    ("name", "count", "kind"),
    [("ft", 1, "missing_topic"), ("ft", 2, "partly_recorded"), ("position", 20, "partly_recorded")],
)
def test_a_channel_of_a_few_samples_is_reported_and_left_out_of_the_fit(record, name, count, kind):
    """One sample was a bug of rsea in every verb, up to nine were not reported, up to 31 refused the rest."""
    short = first(record, name, count)
    assert (kind, name) in {(f.kind, f.channel) for f in check_record(short, load_rig(RIG)).faults}
    fit = rsea.identify(short, RIG)
    assert fit.verdict == "adequate" and name not in fit.result.residual_rms
    assert (kind, name) in {(f.kind, f.channel) for f in fit.result.faults}


def test_gaps_of_all_channels_are_no_jump_of_the_clocks_of_some(record):
    """Sensors that end a gap later than the commands lost their first gap: 26 times the noise."""
    bursts = {n: np.mod(c.t, 1.0) < 0.5 for n, c in record.channels.items()}
    assert record["ft"].t[-1] - record["command"].t[bursts["command"]][-1] > 0.5
    cut = record.with_channels(
        **{n: Channel(record[n].t[on], record[n].y[on]) for n, on in bursts.items()}
    )
    repaired, faults = repair_stamps(cut)
    assert "clock_jump" not in {f.kind for f in faults}
    for name, channel in cut.channels.items():
        np.testing.assert_array_equal(repaired[name].t, channel.t)


def test_a_sensor_that_ends_early_in_a_long_record_still_takes_part_in_its_checks():
    """The checks look at the 30 s of the largest commands: without a sample of it they ended in a bug."""
    command = np.linspace(5.0, 15.0, 70 * 280) * np.random.default_rng(1).standard_normal(70 * 280)
    long = rsea.simulate(RIG, command, 280.0)
    findings = check_record(first(long, "ft", 35 * 280), load_rig(RIG), values=True)
    assert {f.kind for f in findings.findings if f.light != "green"} == {"partly_recorded"}
    assert ("clock_drift", "ft") in {(f.kind, f.channel) for f in findings.findings}
    assert check_record(first(long, "ft", 10 * 280), load_rig(RIG), values=True).light == "amber"


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
    findings = check_record(rounded, load_rig(RIG))
    assert {(f.light, f.channel) for f in findings.of("rounded_stamps")} == {
        ("amber", n) for n in rounded.channels
    }
    assert [f.value for f in findings.of("rate")] == pytest.approx([280.0] * len(rounded.channels), rel=1e-3)
