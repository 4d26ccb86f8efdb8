"""The records of the second bench: sensors as on the paper's, effects that show, faults of known share."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.faults import FAULTS
from independent.hidden import (
    BESIDE_THE_CONTRACT,
    CATALOGUE,
    OFF_CATALOGUE,
    hide,
    hide_beside_the_contract,
    hide_off_catalogue,
)
from independent.plant import Bench, Plant
from independent.severities import SEVERITIES, drawn_parameters

NOISE = {"ft": 0.03, "position": 3.7e-6, "velocity": 2.1e-4, "motor_torque": 0.052}
QUIET = dict.fromkeys(
    ("ft_noise", "position_quantum", "velocity_noise", "velocity_quantum", "motor_noise", "motor_quantum"),
    0.0,
)


def _quiet(bench):
    return record_run(bench.with_values(**QUIET), 3, duration=10.0)


@functools.cache
def _nominal():
    return _quiet(Bench())


def _change(bench):
    """Return how far the bench's record is from a nominal one, in noise RMS, for the clearest channel."""
    quiet_record, nominal = _quiet(bench), _nominal()
    return max(
        np.sqrt(np.mean((quiet_record[k].y - nominal[k].y) ** 2)) / noise for k, noise in NOISE.items()
    )


def test_a_seed_determines_the_record():
    first, again, other = (record_run(Bench(), seed, duration=2.0) for seed in (1, 1, 2))
    for name in first.channels:
        np.testing.assert_array_equal(first[name].y, again[name].y)
        assert not np.array_equal(first[name].y, other[name].y)


def test_noise_is_the_sensors():
    loud, quiet = (record_run(b, 5, duration=20.0) for b in (Bench(), Bench().with_values(**QUIET)))
    for name, noise in NOISE.items():
        assert np.std(loud[name].y - quiet[name].y) == pytest.approx(noise, rel=0.05), name


def test_stamps_say_when_a_hold_began_and_when_it_was_measured():
    record = record_run(Bench(), 5, duration=5.0)
    assert record["command"].t[0] == 0.0
    np.testing.assert_allclose(record["ft"].t - record["command"].t, 1.0 / 280.0, atol=3e-7)
    assert 1e-8 < np.std(np.diff(record["ft"].t)) < 3e-7


def test_benches_differ_in_their_values_and_not_by_an_effect():
    plants = [drawn_bench(np.random.default_rng(seed)).plant for seed in range(200)]
    for name, spread in (("j_m", 0.15), ("b_m", 0.10), ("k_s", 0.03)):
        ratio = np.array([getattr(p, name) for p in plants]) / getattr(Plant(), name)
        assert 0.9 * spread < np.max(np.abs(ratio - 1.0)) <= spread


@pytest.mark.parametrize("effect", CATALOGUE)
def test_a_hidden_effect_shows_and_a_stronger_one_shows_more(effect):
    shown = []
    for severity in SEVERITIES:
        parameters = drawn_parameters(effect, severity, np.random.default_rng(0))
        shown.append(_change(hide(Bench(), effect, parameters)))
    assert 1.0 < shown[0] < shown[1] < shown[2]


@pytest.mark.parametrize("effect", BESIDE_THE_CONTRACT)
def test_an_effect_beside_the_contract_shows(effect):
    assert _change(hide_beside_the_contract(Bench(), effect)) > 2.0


@pytest.mark.parametrize("effect", OFF_CATALOGUE)
def test_an_effect_outside_the_catalogue_shows(effect):
    assert _change(hide_off_catalogue(Bench(), effect)) > 2.0


def test_faults_touch_the_share_that_they_say():
    record = record_run(Bench(), 5, duration=20.0)
    faulty = {name: fault(record, np.random.default_rng(1)) for name, fault in FAULTS.items()}
    n, y, t = len(record["ft"]), record["ft"].y, record["ft"].t
    still = np.mean(np.diff(faulty["frozen_samples"]["ft"].y) == 0.0)
    assert still == pytest.approx(0.05, abs=0.01)
    assert 1.0 - len(faulty["dropped_samples"]["ft"]) / n == pytest.approx(0.03, abs=0.006)
    assert np.mean(np.diff(faulty["duplicate_stamps"]["ft"].t) == 0.0) == pytest.approx(0.02, abs=0.002)
    assert np.max(np.diff(faulty["clock_jump"]["ft"].t)) == pytest.approx(0.5, abs=0.01)
    assert np.mean(faulty["outliers"]["ft"].y != y) == pytest.approx(0.01, abs=0.001)
    clipped = faulty["clipping"]["ft"].y
    assert np.mean(np.abs(clipped) == np.max(np.abs(clipped))) == pytest.approx(0.02, abs=0.002)
    assert np.mean(np.isnan(faulty["nan"]["ft"].y)) == pytest.approx(0.01, abs=0.001)
    assert "ft" not in faulty["missing_topic"]
    assert t[-1] == record["ft"].t[-1]
