"""Channels of a few samples are reported and left out; gaps that all channels share are no clock jumps."""

from __future__ import annotations

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
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


@pytest.mark.parametrize("name", ["ft", "position"])
@pytest.mark.parametrize(
    ("count", "kind"), [(1, "missing_topic"), (2, "partly_recorded"), (20, "partly_recorded")]
)
def test_a_channel_of_a_few_samples_is_reported_and_left_out_of_the_fit(record, name, count, kind):
    """One sample was a bug of rsea in every verb, up to nine were not reported, up to 31 refused the rest."""
    short = first(record, name, count)
    assert (kind, name) in {(f.kind, f.channel) for f in check_record(short, load_rig(RIG)).faults}
    fit = rsea.identify(short, RIG)
    assert fit.verdict == "adequate" and name not in fit.result.residual_rms
    assert (kind, name) in {(f.kind, f.channel) for f in fit.result.faults}


def test_a_prediction_of_a_constant_channel_has_no_fit(record):
    """It was -1e18 %: the constant is not its own mean in floating point."""
    flat = record.with_channels(ft=Channel(record["ft"].t, np.full(len(record["ft"]), 1.23)))
    assert rsea.predict(RIG, flat)["ft"].fit_percent == 0.0


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
