"""Faults of samples at each limit and just beyond: dead, coarse, alone, clipped, unknown; counted by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.checks import faults
from rsea_ros.checks.expected import Side
from rsea_ros.checks.faults import (
    _constant,
    _fill,
    _has_steps,
    _shows,
    _without_unknown_commands,
    clipping,
    coarse,
    dead_channels,
    not_finite,
    outliers,
)
from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import Channel, Record

RIG = SimpleNamespace(sensors={"ft": Sensor(noise=0.1), "position": Sensor(noise=0.1, quantum=0.2)})
T = np.arange(200.0) / 100.0
WAVE = np.sin(9.0 * T) + 0.3 * np.sin(31.0 * T)


def channel(values):
    y = np.asarray(values, float)
    return Channel(np.arange(len(y)) / 100.0, y)


def where(marked):
    return np.flatnonzero(marked).tolist()


def teeth(count=60, **at):
    """Return 0, 1, 0, 1, …: of the ten around a 0 six are 1, so it is 12 spreads of 1 from 1 or further."""
    y = np.arange(count) % 2.0
    for name, value in at.items():
        y[int(name.removeprefix("at"))] = value
    return channel(y)


@pytest.mark.parametrize(
    ("made", "marked"),
    [
        (teeth(at30=13.0), []), (teeth(at30=13.1), [30]), (teeth(at30=-11.0), []), (teeth(at30=-11.1), [30]),
        (teeth(at31=12.0), []), (teeth(at31=12.1), [31]), (teeth(at31=-12.0), []), (teeth(at31=-12.1), [31]),
        (teeth(at30=20.0, at31=20.0), [30, 31]), (teeth(at30=20.0, at31=-20.0), [30, 31]),
        (teeth(at29=20.0, at30=20.0, at31=20.0, at32=20.0), []),
        (teeth(at0=20.0), [0]), (teeth(at59=-20.0), [59]), (teeth(at20=np.nan, at30=13.1), [30]),
        (teeth(19, at9=20.0), []), (teeth(20, at9=20.0), [9]), (channel([np.nan] * 40), []),
        (channel(np.arange(60) % 2 + 20.0 * (np.arange(60) > 30)), []),  # a step
        (channel(np.arange(40.0) + 47.0 * (np.arange(40) == 20)), []),  # of a ramp 12 times four steps
        (channel(np.arange(40.0) + 49.0 * (np.arange(40) == 20)), [20]),
    ],
)  # fmt: skip
def test_an_outlier_is_further_than_twelve_spreads_from_those_around_it(made, marked):
    assert where(outliers(made, "ft")) == marked
    assert not outliers(made, "command").any()


def risen(extreme, inside=0, apart=False):
    """Return 100 values below 1, no two alike, so many of them at 1 in the middle, and so many just below."""
    y = np.random.default_rng(3).permutation(np.linspace(-1.0, 0.9, 100))
    y[40 : 40 + extreme * (1 + apart) : 1 + apart] = 1.0
    y[5 : 5 + 2 * inside : 2] = 0.95
    return channel(y)


@pytest.mark.parametrize(
    ("made", "count"),
    [(risen(7), 0), (risen(8), 8), (risen(12), 12), (risen(12, apart=True), 0), (risen(8, inside=2), 8),
     (risen(11, inside=3), 0), (risen(12, inside=3), 12)],
)  # fmt: skip
def test_many_samples_in_a_row_at_the_extreme_are_clipping(made, count):
    assert where(clipping(made, "ft")) == where(made.y == 1.0) * (count > 0)
    below = Channel(made.t, -made.y)
    assert np.count_nonzero(clipping(below, "position")) == count
    assert not any(clipping(made, name).any() for name in ("command", "reference", "motor_torque"))
    assert not clipping(channel([np.nan] * 40), "ft").any()


def test_a_motion_that_slows_down_to_its_end_is_no_clipping():
    """It comes to its extreme by steps a hundredth of the usual ones; a limit cuts it off at full speed."""
    rise = np.concatenate([np.arange(0.0, 1.0, 0.1), 1.0 - 0.1 * 0.5 ** np.arange(1, 12)])
    rest = np.full(12, 1.0)
    slow = np.concatenate([rise, rest, rise[::-1]])
    assert not clipping(channel(slow), "position").any()
    quick = np.concatenate([rise[:10], rest, rise[9::-1]])
    assert where(clipping(channel(quick), "position")) == list(range(10, 22))


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
    noise = np.random.default_rng(1).standard_normal((4, 208))
    moving = {n: channel(np.convolve(e, np.ones(9), "valid")) for n, e in zip(NAMES, noise, strict=True)}
    record = Record(moving)
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
    heard = Record({n: channel(c.y + 9.0 * np.cumsum(moving["command"].y)) for n, c in moving.items()})
    assert not dead_channels(heard, {}, RIG, pairs=pairs), "by its own power it has much in common"


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
    assert where(not_finite(channel([0.0, np.nan, np.inf, -np.inf, 1.0]), "ft")) == [1, 2, 3]
    assert bool(coarse(channel(2.0 * step * np.round(WAVE / (2.0 * step))), "position", RIG)) == told


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
