"""Gaps of a record: the simulation begins anew behind them, and the filter smears them over nothing."""

import functools

import numpy as np
import pytest
from runs import RIG, excited

import rsea_ros as rsea
from rsea_ros.checks.faults import check
from rsea_ros.model import inverse
from rsea_ros.records.holds import lost_commands
from rsea_ros.records.record import Channel, Record

SOUND = rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(4200), rate=280.0, seed=1)


def without(*spans, names=tuple(SOUND.channels)):
    """Return the record without the rows of some spans, s."""
    keep = {n: np.all([(c.t < a) | (c.t >= b) for a, b in spans], axis=0) for n, c in SOUND.channels.items()}
    return SOUND.with_channels(**{n: Channel(SOUND[n].t[keep[n]], SOUND[n].y[keep[n]]) for n in names})


def test_predict_and_identify_leave_only_noise_beside_two_gaps():
    """37 times the noise after 8 s without rows: the last command was held and its end state gone on with."""
    record = without((3.0, 4.0), (8.0, 11.0))
    before, after = rsea.predict("paper_high_impedance", SOUND), rsea.predict(RIG, record)
    for n in ("ft", "position", "velocity"):
        assert after[n].rms_error == pytest.approx(before[n].rms_error, rel=0.1)
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.15
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=1.0)


ROWS = [(4, 12, "position"), (1, 60, "position"), (4, 12, "ft")]


@pytest.mark.parametrize(("rows", "times", "sensor"), ROWS)
def test_rows_that_a_recorder_lost_are_no_misfit(rows, times, sensor):
    """One row in a hundred lost: 8 times the noise, for the command before it was held."""
    at = np.random.default_rng(6).choice(np.arange(300, 3900), times, replace=False) / 280.0
    left = without(*((a - 1e-4, a + (rows - 0.5) / 280.0) for a in at))
    record = Record({n: left[n] for n in ("command", sensor)})
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.25
    assert fit.rig["rotor.reflected_inertia"] == pytest.approx(0.953, rel=0.01)


def test_cycles_that_were_never_sent_hold_the_command_before_them():
    """The rows are missing of a machine that held: its motor torque shows it, and nothing begins anew."""
    command = SOUND["command"].y.copy()
    lost = np.arange(400, 4000, 37)
    command[lost] = command[lost - 1]
    held = rsea.simulate(RIG, command, rate=280.0, seed=1)
    keep = {n: ~np.isin(np.rint(280.0 * c.t), lost) for n, c in held.channels.items()}
    record = Record({n: Channel(c.t[keep[n]], c.y[keep[n]]) for n, c in held.channels.items()})
    assert lost_commands(record) == []
    assert max(rsea.identify(record, RIG).result.times_noise.values()) < 1.1
    blind = Record({n: c for n, c in record.channels.items() if n != "motor_torque"})
    assert len(lost_commands(blind)) == len(lost)


def test_a_reading_within_a_period_says_nothing_of_the_cycles_behind_it():
    """It shows the command of its own row, whether later ones were lost or not: 1.33 times the noise."""
    torque = Channel(SOUND["command"].t + 0.6 / 280.0, SOUND["command"].y)
    lost = np.arange(400, 4000, 37)
    sound = SOUND.with_channels(motor_torque=torque)
    keep = {n: ~np.isin(np.floor(280.0 * c.t + 1e-6), lost) for n, c in sound.channels.items()}
    record = Record({n: Channel(c.t[keep[n]], c.y[keep[n]]) for n, c in sound.channels.items()})
    assert len(lost_commands(record)) == len(lost)


def test_commands_that_pause_alone_are_held_where_no_motor_torque_shows_others():
    paused = without((5.0, 8.0), names=("command",))
    unknown = Record({n: c for n, c in paused.channels.items() if n != "motor_torque"})
    assert lost_commands(unknown) == []
    (only,) = lost_commands(without((5.0, 8.0)))
    assert only == pytest.approx((5.0, 8.0), abs=0.01)


def only_commands_without(record, begin, end):
    command = record["command"]
    keep = (command.t < begin) | (command.t >= end)
    return record.with_channels(command=Channel(command.t[keep], command.y[keep]))


def test_commands_that_were_lost_are_a_gap_where_the_motor_torque_shows_others():
    """142 times the noise, which nothing of the catalogue explained: the last command was held for 0.7 s."""
    record = only_commands_without(SOUND, 5.0, 5.7)
    (only,) = lost_commands(record)
    assert only == pytest.approx((5.0, 5.7), abs=0.01)
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.15
    predicted = rsea.predict(RIG, record)
    for n, sound in rsea.predict(RIG, SOUND).items():
        assert predicted[n].rms_error == pytest.approx(sound.rms_error, rel=0.1)


def test_commands_that_are_published_on_change_are_held():
    command = SOUND["command"].y.copy()
    command[1400:1600] = command[1400]
    held = rsea.simulate(RIG, command, rate=280.0, seed=1)
    assert lost_commands(only_commands_without(held, 1400.5 / 280.0, 1600.0 / 280.0)) == []


def test_a_motor_torque_that_is_never_a_number_shows_nothing_of_a_pause():
    paused = only_commands_without(SOUND, 5.0, 5.7)
    dead = Channel(paused["motor_torque"].t, np.full(len(paused["motor_torque"]), np.nan))
    assert lost_commands(paused.with_channels(motor_torque=dead)) == []


def test_commands_that_are_no_numbers_are_lost_ones():
    """A diagnosis drew a line through them and found 59 times the noise."""
    command = SOUND["command"].y.copy()
    command[1400:1600] = np.nan
    checked = check(SOUND.with_channels(command=Channel(SOUND["command"].t, command)), RIG)
    assert ("nan", "command") in {(f.kind, f.channel) for f in checked.faults}
    assert len(checked.record["command"]) == len(checked.masked["command"]) == 4000
    assert len(lost_commands(checked.record)) == 1


@functools.cache
def whole():
    return excited("pendulum", "chirp", sensors=3, duration=20.0, amplitude=10.0, noise=2.0)


def missing(seconds, *names):
    """Return the run without the samples of some channels from 8 s on."""
    left_out = {n: (c.t >= 8.0) & (c.t < 8.0 + seconds) for n in names for c in [whole()[n]]}
    kept = {n: Channel(whole()[n].t[~out], whole()[n].y[~out]) for n, out in left_out.items()}
    return whole().with_channels(**kept)


ALL = ("command", "position", "velocity", "motor_torque")


def test_a_gap_changes_no_result():
    """Half a second without rows took the prediction from 96 to 78 % and made a sound fit a misfit."""
    record, truth = missing(0.5, "position"), rsea.load_rig("pendulum")
    predicted = rsea.predict("pendulum", record)["motor_torque"]
    sound = rsea.predict("pendulum", whole())["motor_torque"]
    assert predicted.rms_error == pytest.approx(sound.rms_error, rel=0.15)
    fit = rsea.identify(record, "pendulum")
    assert fit.verdict == "adequate"
    assert "dropped_samples" in {fault.kind for fault in fit.result.faults}
    for name, estimate in fit.parameters.items():
        low, high = estimate.ci95
        assert low < truth[name] < high


@pytest.mark.parametrize("off", [4e-10, -4e-10])
def test_stamps_rounded_to_nanoseconds_change_no_prediction(off):
    """The same run as a bag and as arrays: an RMS of 0.21 and 0.91 N m."""
    stamps = {n: np.round(c.t, 9) + off * (n == "command") for n, c in whole().channels.items()}
    rounded = Record({n: Channel(t, whole()[n].y) for n, t in stamps.items()})
    predicted = rsea.predict("pendulum", rounded)["motor_torque"]
    sound = rsea.predict("pendulum", whole())["motor_torque"]
    assert predicted.rms_error == pytest.approx(sound.rms_error, rel=1e-3)
    assert predicted.fit_percent > 95.0


def test_nothing_of_a_gap_is_compared():
    predicted = rsea.predict("pendulum", missing(5.0, *ALL))["motor_torque"]
    inside = (predicted.t > 7.8) & (predicted.t < 13.2)
    assert inside.any() and not predicted.counts[inside].any()
    np.testing.assert_array_equal(predicted.counts[~inside][400:600], True)


@pytest.mark.parametrize("names", [("command",), ("command", "motor_torque")])
@pytest.mark.parametrize("off", [0.0, 4e-10, -4e-10])
def test_a_held_torque_is_neither_early_nor_late(names, off):
    """Every edge took the value behind it: torques 0.2 ms early, and 1 of 24 intervals of J_m with the truth.

    The torque is a step at 1 s: its integral from 0.5 to 1.5 s is 0.5 N m s, more where it is early.
    """
    t = np.arange(0.0, 2.0, 0.25)
    step = (t >= 1.0).astype(float)
    channels = {"command": Channel(t + off, step), "motor_torque": Channel(t + 0.25, step)}
    record = Record({n: channels[n] for n in names})
    fine = np.arange(0.5, 1.51, 0.05)
    torque = inverse._torque_at(record, fine)
    assert np.trapezoid(torque, fine) == pytest.approx(0.5, abs=1e-6)
