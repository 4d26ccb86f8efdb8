"""A gap of the whole record: what was commanded in it is unknown, so the simulation begins anew behind it."""

from __future__ import annotations

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.checks.faults import check
from rsea_ros.model.drive import gaps
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

RIG = load_rig("paper_high_impedance")
SOUND = rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(4200), rate=280.0, seed=1)


def without(*spans, names=tuple(SOUND.channels)):
    """Return the record without the rows of some spans, s."""
    keep = {n: np.all([(c.t < a) | (c.t >= b) for a, b in spans], axis=0) for n, c in SOUND.channels.items()}
    return SOUND.with_channels(**{n: Channel(SOUND[n].t[keep[n]], SOUND[n].y[keep[n]]) for n in names})


@pytest.mark.parametrize("spans", [[(5.0, 8.0)], [(3.0, 4.0), (8.0, 8.5)]])
def test_predict_and_identify_leave_only_noise_beside_a_gap(spans):
    """37 times the noise after 8 s without rows: the last command was held and its end state gone on with."""
    record = without(*spans)
    before, after = rsea.predict("paper_high_impedance", SOUND), rsea.predict(RIG, record)
    for n in ("ft", "position", "velocity"):
        assert after[n].rms_error == pytest.approx(before[n].rms_error, rel=0.1)
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.15
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=1.0)


def test_commands_that_pause_alone_are_held_where_no_motor_torque_shows_others():
    paused = without((5.0, 8.0), names=("command",))
    unknown = Record({n: c for n, c in paused.channels.items() if n != "motor_torque"})
    assert gaps(unknown) == []
    (only,) = gaps(without((5.0, 8.0)))
    assert only == pytest.approx((5.0, 8.0), abs=0.01)


def test_a_short_gap_goes_on_with_the_last_command():
    assert gaps(without((5.0, 5.03))) == []


def only_commands_without(record, begin, end):
    command = record["command"]
    keep = (command.t < begin) | (command.t >= end)
    return record.with_channels(command=Channel(command.t[keep], command.y[keep]))


def test_commands_that_were_lost_are_a_gap_where_the_motor_torque_shows_others():
    """142 times the noise, which nothing of the catalogue explained: the last command was held for 0.7 s."""
    record = only_commands_without(SOUND, 5.0, 5.7)
    (only,) = gaps(record)
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
    assert gaps(only_commands_without(held, 1400.5 / 280.0, 1600.0 / 280.0)) == []


def test_a_motor_torque_that_is_never_a_number_shows_nothing_of_a_pause():
    paused = only_commands_without(SOUND, 5.0, 5.7)
    dead = Channel(paused["motor_torque"].t, np.full(len(paused["motor_torque"]), np.nan))
    assert gaps(paused.with_channels(motor_torque=dead)) == []


def test_commands_that_are_no_numbers_are_lost_ones():
    """A diagnosis drew a line through them and found 59 times the noise."""
    command = SOUND["command"].y.copy()
    command[1400:1600] = np.nan
    checked = check(SOUND.with_channels(command=Channel(SOUND["command"].t, command)), RIG)
    assert ("nan", "command") in {(f.kind, f.channel) for f in checked.faults}
    assert len(checked.record["command"]) == len(checked.masked["command"]) == 4000
    assert len(gaps(checked.record)) == 1
