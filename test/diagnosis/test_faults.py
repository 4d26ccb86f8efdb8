"""Faults of the data: each kind put into a good record is found in its channel and in no other."""

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.faults import FAULTS
from runs import RIG, only

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.records.record import Channel
from rsea_ros.report.diagnosis.words import diagnosis_sentence, headline
from rsea_ros.report.remark_words import remark_sentences


@pytest.fixture(scope="module")
def good():
    return record_run(drawn_bench(np.random.default_rng(7)), 8, "chirp_noise", 12.0)


def test_a_good_record_has_no_faults(good):
    assert check(good, RIG).faults == ()


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_found_and_the_rest_stays_whole(good, kind):
    checked = check(FAULTS[kind](good, np.random.default_rng(9)), RIG)
    assert {f.kind for f in checked.faults} == {kind}
    for channel in checked.record.channels.values():
        assert np.all(np.isfinite(channel.y)) and np.all(np.diff(channel.t) > 0.0)


def test_coarse_steps_are_reported_and_nothing_is_masked(good):
    ft = good["ft"]
    stepped = good.with_channels(ft=Channel(ft.t, np.round(ft.y / 0.8) * 0.8))
    checked = check(stepped, RIG)
    assert [(f.kind, f.channel) for f in checked.faults] == [("coarse_steps", "ft")]
    assert not checked.masked["ft"].any()


@pytest.mark.parametrize(("name", "value"), [("ft", 0.0), ("position", np.nan)])
def test_a_dead_sensor_is_reported_and_the_others_are_used(good, name, value):
    dead = good.with_channels(**{name: Channel(good[name].t, np.full(len(good[name]), value))})
    diagnosis = diagnose([dead], RIG)
    assert {f.channel for f in diagnosis.faults} == {name}
    assert (diagnosis.verdict, diagnosis.causes, diagnosis.next_experiment) == ("unexplained", (), None)
    assert "measures nothing and is left out" in diagnosis_sentence(diagnosis)
    assert headline(diagnosis).endswith("measures nothing; in the other channels only noise is left")


def test_stamps_that_scatter_are_put_on_the_even_clock_and_it_is_said(good):
    """The verdict on this bench was `unexplained`."""
    off = np.random.default_rng(10).uniform(-3e-4, 3e-4, (2, len(good["command"])))
    scattered = {n: Channel(c.t + off[0 if n == "ft" else 1], c.y) for n, c in good.channels.items()}
    diagnosis = diagnose([good.with_channels(**scattered)], RIG)
    assert diagnosis.verdict == "nothing_wrong"
    first = remark_sentences(diagnosis.remarks)[0]
    assert first.startswith("Stamps scatter about an even clock: command by 0.17 ms RMS")


def test_a_diagnosis_without_the_ft_sensor_says_what_every_torque_rests_on(good):
    diagnosis = diagnose([only(good, "position", "velocity", "motor_torque")], RIG)
    assert diagnosis.remarks[0].code == "torque_by_motor_constant"
