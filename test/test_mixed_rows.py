"""A log sorted by the stamps of a clock that stepped back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.records.record import Channel
from rsea_ros.records.stamps import repair_stamps

RIG = rsea.load_rig("paper_high_impedance")
SOUND = rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(4200), rate=280.0)


def sorted_after(step):
    """Return the run with a clock that steps back in the middle, its rows sorted by their stamps."""
    channels = {}
    for n, c in SOUND.channels.items():
        t = np.where(c.t > 7.5, c.t - step, c.t)
        order = np.argsort(t, kind="stable")
        channels[n] = Channel(t[order], c.y[order])
    return SOUND.with_channels(**channels)


@pytest.mark.parametrize("step", [3.0, 3.0013])
def test_rows_of_two_times_are_left_out_and_the_rest_is_sound(step):
    """17 % were read as duplicates, and 7.8 times the noise came with reassuring intervals."""
    record, faults = repair_stamps(sorted_after(step))
    assert {f.kind for f in faults} == {"mixed_rows", "dropped_samples"}
    (mixed,) = [f for f in faults if f.kind == "mixed_rows"]
    assert mixed.size == pytest.approx(step, abs=0.2) and "stepped back" in mixed.detail
    sound = rsea.predict(RIG, SOUND)
    left = rsea.predict(RIG, record)
    for n in ("ft", "position", "velocity"):
        assert left[n].rms_error == pytest.approx(sound[n].rms_error, rel=0.2)


def test_messages_that_came_twice_are_no_mixed_rows():
    twice = {}
    for n, c in SOUND.channels.items():
        k = np.repeat(np.arange(len(c)), np.where(abs(c.t - 7.0) < 2.0, 2, 1))
        twice[n] = Channel(c.t[k], c.y[k])
    record = SOUND.with_channels(**twice)
    assert {f.kind for f in repair_stamps(record)[1]} == {"duplicate_stamps"}


def test_a_log_whose_rate_halves_keeps_every_row():
    """`the clock stepped back by 18.6 s`, and 76 % of a sound record left out: the dense half of it."""
    sparse = {}
    for n, c in SOUND.channels.items():
        k = np.r_[np.arange(0, 2100), np.arange(2100, len(c), 2)]
        sparse[n] = Channel(c.t[k], c.y[k])
    record, faults = repair_stamps(SOUND.with_channels(**sparse))
    assert "mixed_rows" not in {f.kind for f in faults}
    assert len(record["position"]) == len(sparse["position"])


def test_rows_that_are_left_out_can_be_kept_and_are_red():
    mixed = sorted_after(3.0013)
    assert len(repair_stamps(replace(mixed, keeps_rows=True))[0]["ft"]) == len(SOUND["ft"])
    (left_out,) = [f for f in check_record(mixed, RIG).findings if f.kind == "mixed_rows"]
    assert left_out.light == "red" and "--keep-rows" in left_out.remedy
