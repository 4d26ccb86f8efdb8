"""Faults of samples at their limits: dead, coarse, alone, clipped, unknown; by signals made for each."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.checks import faults
from rsea_ros.checks.expected import Side
from rsea_ros.checks.faults import (
    _common,
    _constant,
    _fill,
    _has_steps,
    _rests,
    _shows,
    _without_unknown_commands,
    clipping,
    coarse,
    dead_channels,
    outliers,
)
from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import Channel, Record

RIG = SimpleNamespace(sensors={"ft": Sensor(noise=0.1), "position": Sensor(noise=0.1, quantum=0.2)})
T = np.arange(200.0) / 100.0
WAVE = np.sin(9.0 * T) + 0.3 * np.sin(31.0 * T)


def channel(y, t=None):
    return Channel(T[: len(y)] if t is None else t, np.asarray(y, float))


def pair(x, y, coherence=0.9, unrelated=False):
    return SimpleNamespace(law=SimpleNamespace(x=x, y=y), coherence=coherence, unrelated=unrelated)


LINKED = [pair("command", "position"), pair("position", "velocity", 0.51)]
NAMES = ("command", "position", "velocity", "ft")


@pytest.mark.parametrize(
    ("pairs", "dead"),
    [
        ([*LINKED, pair("command", "ft", 0.19), pair("position", "ft", 0.1)], ["ft"]),
        ([*LINKED, pair("command", "ft", 0.21), pair("position", "ft", 0.1)], []),
        ([*LINKED, pair("command", "ft", 0.9, unrelated=True)], ["ft"]),
        ([pair("command", "position", 0.49), pair("command", "ft", 0.1)], []),
        ([pair("command", "ft", 0.51), pair("command", "position", 0.1)], ["position"]),
        (LINKED, []),
        ([*LINKED, pair("command", "ft", 0.0)], []),
    ],
)
def test_a_sensor_is_dead_that_shares_nothing_with_others_that_share_much(pairs, dead):
    record = Record({n: channel(WAVE + 0.1 * k) for k, n in enumerate(NAMES)})
    found = dead_channels(record, {}, RIG, pairs=pairs)
    assert [f.channel for f in found] == dead
    for f in found:
        assert (f.kind, f.share) == ("dead_channel", 1.0)
        assert f.detail == "noise that has nothing to do with the other channels"
    assert not dead_channels(record, {}, RIG, frozen=dead, pairs=pairs)
    hidden = {n: Side(T, WAVE, 0.1 * WAVE) for n in dead}
    assert not dead_channels(record, hidden, RIG, pairs=pairs)
    still = Record({n: channel(np.zeros(200)) for n in NAMES})
    assert not dead_channels(still, {}, RIG, pairs=pairs)


def test_a_constant_channel_is_dead_where_its_signal_would_show():
    assert _constant(channel([4.0, 4.0]), "ft", None, RIG) == "constant at 4"
    assert _constant(channel([4.0]), "ft", None, RIG) == "" == _constant(channel([4.0, 4.1]), "ft", None, RIG)
    for name, noise in (("ft", 0.1), ("position", 0.2), ("velocity", 0.0)):
        side = Side(T, T, 3.0 * noise * WAVE / np.std(WAVE))
        for factor, told in ((1.01, True), (0.99, noise == 0.0)):
            shown = Side(T, T, factor * side.p)
            assert bool(_constant(channel(np.full(9, 4.0)), name, shown, RIG)) == told


@pytest.mark.parametrize(
    ("predicted", "measured", "shows"),
    [(0.31, 0.1, True), (0.29, 0.1, False), (1.0, 3.3, True), (1.0, 3.4, False)],
)
def test_a_signal_shows_above_three_noises_and_three_tenths_of_the_channel(predicted, measured, shows):
    unit = WAVE / np.std(WAVE)
    assert _shows("ft", Side(T, measured * unit, predicted * unit), RIG) == shows
    assert _shows("ft", None, RIG)


@pytest.mark.parametrize(("step", "told"), [(0.51, True), (0.49, False)])
def test_steps_of_five_times_those_of_the_sensor_are_coarse(step, told):
    found = coarse(channel(step * np.round(WAVE / step)), "ft", RIG)
    assert bool(found) == told
    for f in found:
        assert (f.kind, f.share) == ("coarse_steps", 1.0)
        assert f.detail == "steps of 0.51 where the rig's sensor has 0.1"
    assert bool(coarse(channel(2.0 * step * np.round(WAVE / (2.0 * step))), "position", RIG)) == told


def test_a_sample_far_from_the_ten_around_it_stands_alone():
    y = WAVE.copy()
    y[[50, 120, 121]] += [5.0, -5.0, -5.2]
    assert np.flatnonzero(outliers(channel(y), "ft")).tolist() == [50, 120, 121]
    three = WAVE.copy()
    three[120:124] += 5.0
    assert not outliers(channel(three), "ft").any()
    jump = WAVE + 5.0 * (T > 1.0)
    assert not outliers(channel(jump), "ft").any()
    assert not outliers(channel(y), "command").any()
    assert not outliers(channel(np.append(np.zeros(10), [9.0] * 1 + [0.0] * 8)), "ft").any()
    assert outliers(channel(np.append(np.arange(10.0), [99.0, *range(11, 20)])), "ft").sum() == 1
    assert not outliers(channel(np.full(40, np.nan)), "ft").any()
    line = np.arange(40.0)
    for off, told in ((47.0, False), (49.0, True)):  # the third largest distance around it is four steps
        bent = line.copy()
        bent[20] += off
        assert outliers(channel(bent), "ft")[20] == told
    odd = y.copy()
    odd[10] = np.nan
    assert np.flatnonzero(outliers(channel(odd), "ft")).tolist() == [50, 120, 121]


def test_many_samples_at_the_extreme_in_a_row_are_clipped():
    top = np.clip(WAVE, -0.9, 0.9)
    marked = clipping(channel(top), "ft")
    assert marked.tolist() == (np.abs(top) == 0.9).tolist() and marked.sum() > 20
    for name in ("command", "reference", "motor_torque"):
        assert not clipping(channel(top), name).any()
    assert not clipping(channel(WAVE), "ft").any()
    assert not clipping(channel(np.full(200, np.nan)), "ft").any()
    highest = np.sort(WAVE)
    few = np.minimum(WAVE, highest[-8])
    assert clipping(channel(few), "ft").sum() in (0, 8)
    assert not clipping(channel(np.minimum(WAVE, highest[-7])), "ft").any()


def test_a_coarse_quantum_has_its_extreme_as_often_as_its_neighbours():
    y = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0], [3, 3, 3, 3, 11])
    assert _common(y, 4.0) and not _common(np.append(y, 4.0), 4.0)
    low = -y
    assert _common(low, -4.0) and not _common(np.append(low, -4.0), -4.0)


def test_a_motion_that_slows_down_to_its_extreme_rests():
    ends = 1.0 + 0.2 * (1.0 - 0.5 ** np.arange(1, 9))
    slow = np.concatenate([np.linspace(0.0, 1.0, 20), ends, np.full(9, 1.2), np.linspace(1.1, 0.0, 20)])
    assert _rests(slow, slow == 1.2)
    cut = np.minimum(np.concatenate([np.linspace(0.0, 2.0, 40), np.linspace(2.0, 0.0, 40)]), 1.225)
    assert not _rests(cut, cut == 1.225)
    assert not _rests(np.full(9, 1.2), np.ones(9, bool)) and not _rests(cut[:24], cut[:24] == 9.0)


def test_commands_that_are_no_numbers_are_left_out_unless_too_few_are_left():
    y = np.arange(30.0)
    y[[3, 7]] = np.nan
    record = Record({"command": channel(y), "ft": channel(np.zeros(30))})
    masked = {"command": np.arange(30) == 4, "ft": np.zeros(30, bool)}
    kept, marks = _without_unknown_commands(record, masked)
    assert len(kept["command"]) == 28 and np.flatnonzero(marks["command"]).tolist() == [3]
    assert kept["ft"] is record["ft"] and len(masked["command"]) == 30
    for count, is_kept in ((10, False), (9, True)):
        few = Record({"command": channel(np.where(np.arange(30) < count, 1.0, np.nan))})
        assert (_without_unknown_commands(few, {"command": np.zeros(30, bool)})[0] is few) == is_kept
    assert _without_unknown_commands(Record({"ft": channel(y)}), {})[1] == {}


def test_a_torque_of_few_commands_has_their_steps_not_its_sensors():
    def steps(count):
        return Record({"command": channel(np.arange(200) % count), "motor_torque": channel(WAVE)})

    assert not _has_steps(steps(round(faults.FEW * 200)), "motor_torque")
    assert _has_steps(steps(round(faults.FEW * 200) + 1), "motor_torque")
    assert _has_steps(Record({"motor_torque": channel(WAVE)}), "motor_torque")
    assert _has_steps(steps(2), "command") and not _has_steps(steps(2), "ft")


def test_bad_values_are_bridged_by_lines():
    y = np.array([0.0, 1.0, np.inf, 3.0, 9.0, 5.0])
    record = Record({"ft": channel(y), "position": channel(np.full(6, np.nan))})
    filled = _fill(record, {"ft": np.arange(6) == 4, "position": np.zeros(6, bool)})
    assert filled["ft"].y.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0] and not filled["position"].y.any()
