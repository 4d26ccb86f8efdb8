"""Findings on stamps: rates at the limits of what the rig needs, and the light of each fault."""

import math

import numpy as np
import pytest

from rsea_ros.checks.stamp_findings import command_band, fault_finding, natural_frequency, rates
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Fault, Record

RIG = load_rig("paper_high_impedance")
NATURAL = math.sqrt(1530.456 / 0.957) / (2.0 * math.pi)
"""Hz: of spring on rotor and chassis, 6.36; four samples to a cycle are 25.5 Hz."""


def channel(rate: float, duration: float = 20.0) -> Channel:
    t = np.arange(0.0, duration, 1.0 / rate)
    return Channel(t, np.random.default_rng(2).standard_normal(len(t)))


@pytest.mark.parametrize(
    ("rate", "command", "top", "light", "words"),
    [
        (200.0, 200.0, math.inf, "green", "longest interval 5 ms"),
        (26.0, 26.0, math.inf, "green", "longest interval"),
        (25.0, 25.0, math.inf, "red", "longest interval 40 ms"),
        (25.0, 25.0, 6.0, "amber", "longest interval 40 ms"),
        (25.0, 25.0, 6.3, "red", "longest interval 40 ms"),
        (121.0, 200.0, math.inf, "green", "longest interval"),
        (119.0, 200.0, math.inf, "amber", "slower than the commands: what is faster folds"),
    ],
)
def test_a_rate_is_enough_for_the_rigs_cycle_and_the_commands(rate, command, top, light, words) -> None:
    found = {
        f.channel: f for f in rates(Record({"command": channel(command), "ft": channel(rate)}), RIG, top)
    }
    ft = found["ft"]
    assert (ft.light, ft.kind, ft.unit) == (light, "rate", "Hz") and ft.value == pytest.approx(rate, rel=1e-3)
    assert ft.detail.startswith(words)
    if rate < 25.5:
        assert ft.expected == f"> 25.5 Hz, four samples to a cycle of the rig's {NATURAL:.3g} Hz"
        assert ft.remedy == "record faster, or name the right rig with --rig"
    elif light == "amber":
        assert ft.expected == "200 Hz as the commands" and ft.remedy == "record it faster"


def test_a_rate_that_changes_and_one_that_no_loop_has() -> None:
    t = np.concatenate([np.arange(0.0, 10.0, 0.005), np.arange(10.0, 20.0, 0.01)])
    (ft,) = rates(Record({"ft": Channel(t, np.sin(t))}), RIG)
    assert ft.detail == "200 Hz until 10 s, 100 Hz at the end; longest interval 10 ms"
    slow = Record({n: channel(2.0, 300.0) for n in ("command", "ft")})
    assert {(f.light, f.expected[:9]) for f in rates(slow, RIG)} == {("red", "> 25.5 Hz")}
    assert all(
        f.remedy.endswith("If so, record faster, or name the right rig with --rig") for f in rates(slow, RIG)
    )
    rigid = load_rig("bare_drive")
    assert natural_frequency(rigid) is None and natural_frequency(RIG) == pytest.approx(NATURAL, rel=1e-6)
    assert [f.expected for f in rates(slow, rigid)] == ["> 4 Hz", "> 4 Hz"]
    short = Record({n: channel(1000.0, 0.29) for n in ("command", "ft")})
    assert [(f.light, f.expected) for f in rates(short, RIG)] == [
        ("red", "more than 0.3 s at up to 50000 Hz")
    ] * 2
    assert all(f.detail == "0.289 s of it" for f in rates(short, RIG))


@pytest.mark.parametrize("hz", [(3.0, 3.0), (2.0, 40.0)])
def test_the_band_of_a_command_holds_all_but_a_hundredth_on_either_side(hz) -> None:
    t = np.arange(4000) / 200.0
    y = 5.0 + sum(np.sin(2.0 * np.pi * f * t) for f in hz)
    assert command_band(Channel(t, y)) == pytest.approx(hz, abs=0.02 * hz[1])


@pytest.mark.parametrize(
    ("kind", "share", "light"),
    [
        ("frozen_samples", 0.2, "amber"),
        ("frozen_samples", 0.21, "red"),
        ("coarse_steps", 1.0, "amber"),
        ("missing_topic", 1.0, "amber"),
        ("dead_channel", 1.0, "red"),
        ("mixed_rows", 0.02, "amber"),
        ("mixed_rows", 0.021, "red"),
        ("stray_stamps", 0.03, "red"),
        ("early_torque", 1.0, "green"),
        ("held_samples", 1.0, "amber"),
        ("outliers", 0.5, "red"),
    ],
)
def test_the_light_of_a_fault_is_that_of_its_share(kind, share, light) -> None:
    found = fault_finding(Fault(kind, "ft", share, "so"))
    assert (found.light, found.kind, found.channel, found.detail) == (light, kind, "ft", "so")
    of_all = kind in ("coarse_steps", "missing_topic", "mixed_rows", "early_torque", "held_samples")
    assert (found.value, found.unit) == ((None, "") if of_all else (100.0 * share, "%"))
    assert found.remedy and found.expected == "none"
    counted = fault_finding(Fault(kind, "ft", share, "so", 12, "samples"))
    assert (counted.value, counted.unit) == (12, "samples")
