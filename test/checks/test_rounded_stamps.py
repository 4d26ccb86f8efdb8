"""Stamps that a logger rounded to whole ms: every verb reports them, and the rate is that of the samples."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.checks.check import check_record
from rsea_ros.checks.stamp_findings import rounded_stamps
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"


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
def record():
    made = rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(1400), 280.0)
    return made.with_channels(**{n: Channel(np.round(c.t, 3), c.y) for n, c in made.channels.items()})


def test_the_check_is_amber_and_names_the_rate_of_the_samples(record):
    """It was green, at 250 Hz: the median of intervals of 3 and 4 ms."""
    findings = check_record(record, load_rig(RIG))
    assert {(f.light, f.channel) for f in findings.of("rounded_stamps")} == {
        ("amber", n) for n in record.channels
    }
    assert [f.value for f in findings.of("rate")] == pytest.approx([280.0] * len(record.channels), rel=1e-3)


def test_predict_reports_them(record, tmp_path, capsys):
    write_record(record, tmp_path / "run.mcap")
    assert main(["predict", RIG, str(tmp_path / "run.mcap")]) == 0
    faults = json.loads(capsys.readouterr().out)["data"]["faults"]
    assert {f["channel"] for f in faults if f["kind"] == "rounded_stamps"} == set(record.channels)
