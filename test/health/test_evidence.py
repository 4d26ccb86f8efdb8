"""Evidence of a look, the threshold of alarms, and fits of single causes."""

import numpy as np
import pytest
from independent.bench import Bench, record_command

from rsea_ros.health.changes import FINALISTS, Fitter
from rsea_ros.health.hypotheses import Bank, Cutter, hypotheses_of
from rsea_ros.health.recursive_estimates import Cusum, Estimates, threshold
from rsea_ros.model.observer import Observer, noise_of
from rsea_ros.model.observer.log import BatchObserver, events_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RATE = 280.0
RIG = load_rig("paper_high_impedance")
HYPOTHESES = hypotheses_of(RIG, 1.0 / RATE)
NAMES = [h.name for h in HYPOTHESES]


def motion(seconds):
    """A command of three tones, N m."""
    t = np.arange(round(seconds * RATE)) / RATE
    return Channel(t, 8.0 * np.sin(5.0 * t) + 5.0 * np.sin(13.0 * t + 1.0) + 3.0 * np.sin(29.0 * t + 2.0))


def looks_of(rig, seconds, seed=0):
    return list(Cutter(1.0).take(*events_of(synthesize(rig, motion(seconds), seed=seed))))


def test_a_block_has_the_innovations_of_the_observer():
    record = synthesize(RIG, motion(1.0), seed=3)
    t, kind, values = events_of(record)
    blocks = BatchObserver(RIG, noise_of(RIG), hold=0.05).innovations(t, kind, values)
    one = Observer(RIG, hold=0.05, learns=False)
    for at, which, (a, b) in zip(t, kind, values, strict=True):
        if which == 0:
            one.state(at, a, b)
        else:
            (one.ft if which == 1 else one.command)(at, a)
    tests = one.consistency()
    for channel, w in (("position", blocks[kind == 0, 0]), ("ft", blocks[kind == 1, 0])):
        assert tests[channel].ratio == pytest.approx(np.sqrt(np.mean(w**2)), rel=1e-6)


def test_a_block_forgets_the_one_before():
    look = looks_of(RIG, 2.0)[0]
    observer = BatchObserver(RIG, noise_of(RIG), hold=0.05)
    first, second = (observer.innovations(look.t, look.kind, look.values) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_estimates_find_a_small_change_and_hold_without_motion():
    changed = RIG.with_values({"spring.stiffness": 1.01 * RIG["spring.stiffness"]})
    bank, estimates = Bank(RIG, noise_of(RIG), HYPOTHESES, 0.05), Estimates(HYPOTHESES)
    phi = np.ones(len(HYPOTHESES))
    for look in looks_of(changed, 6.0):
        estimates.take(*bank.evidence(look).scale_sums(np.ones(3)), phi)
    (computed,) = (e for e in estimates.estimates() if e.name == "spring.stiffness")
    assert computed.ci95[0] < changed["spring.stiffness"] < computed.ci95[1] and not computed.held
    assert computed.ci95[0] > RIG["spring.stiffness"]
    before = estimates.estimates()
    estimates.hold()
    assert [(e.value, e.ci95) for e in estimates.estimates()] == [(e.value, e.ci95) for e in before]
    assert all(e.held for e in estimates.estimates())


def test_the_score_of_a_right_model_is_as_large_as_its_information_says():
    bank = Bank(RIG, noise_of(RIG), HYPOTHESES, 0.05)
    computed = [
        bank.evidence(look).scale_sums(np.ones(3)) for seed in range(2) for look in looks_of(RIG, 6.0, seed)
    ]
    i = NAMES.index("spring.stiffness")
    z = np.array([c[i] / np.sqrt(a[i, i]) for c, a in computed])
    assert np.mean(z**2) < 2.0 and abs(np.mean(z)) < 1.0


INNER, OUTER = np.array([1.0, 0.5]), np.array([2.0, 1.5])
NONE = np.ones(2)
EVERY = 3.0


def rate_of_alarms(h, change, looks, seed):
    """Alarms an hour of looks with scores of a change, of information drawn for each look."""
    rng, cusum, alarms = np.random.default_rng(seed), Cusum(INNER, OUTER, h), 0
    for _ in range(looks):
        information = rng.uniform(0.0, 3.0, 2)
        score = information * change + np.sqrt(information) * rng.standard_normal(2)
        if cusum.take(score, information, NONE):
            alarms += 1
            cusum = Cusum(INNER, OUTER, h)
    return alarms / (looks * EVERY / 3600.0)


def test_false_alarms_stay_below_the_stated_rate_even_at_the_edge_of_the_doubt():
    stated = 20.0
    h = threshold(stated, 4, EVERY)
    assert rate_of_alarms(h, INNER, 20_000, seed=1) <= stated
    assert rate_of_alarms(h, OUTER, 1_000, seed=1) > 5.0 * stated


def test_a_change_is_found_within_a_few_looks_and_only_with_excitation():
    cusum = Cusum(INNER, OUTER, threshold(1e-3, 4, EVERY))
    looks = 0
    while not cusum.take(np.array([40.0, 0.0]), np.array([20.0, 0.0]), NONE):
        looks += 1
    assert looks == 2 and cusum.since == 3
    cusum = Cusum(INNER, OUTER, threshold(1e-3, 4, EVERY))
    assert not any(cusum.take(np.zeros(2), np.zeros(2), NONE) for _ in range(1000)) and not cusum.suspects


def test_a_single_look_is_never_an_alarm():
    cusum = Cusum(INNER, OUTER, threshold(1e-3, 4, EVERY))
    assert not cusum.take(np.full(2, 1e9), np.full(2, 1.0), NONE) and cusum.suspects


def looks_with(**fault):
    """Four looks of the bench with a fault."""
    t = np.arange(round(6.0 * RATE)) / RATE
    gait = sum(8.0 / h * np.sin(2 * np.pi * 1.1 * h * t + h) for h in (1, 2, 3, 4))
    gait *= np.clip(2.0 * t, 0.0, 1.0)
    run = record_command(Bench().with_values(**fault), gait, np.random.default_rng(1))
    return list(Cutter(1.25).take(*events_of(run)))[-4:]


def test_only_the_causes_that_explain_the_clearest_look_are_fitted_to_all(monkeypatch):
    looks, runs = looks_with(gap=4e-3), []
    innovations = BatchObserver.innovations

    def counted(self, t, *args):
        runs.append(float(t[0]))
        return innovations(self, t, *args)

    monkeypatch.setattr(BatchObserver, "innovations", counted)
    rig = load_rig("paper_high_impedance")
    hypotheses = hypotheses_of(rig, 1.0 / RATE)
    fitter = Fitter(rig, noise_of(rig), 0.1, looks, np.ones(3))
    causes = fitter.causes(hypotheses, np.zeros(len(hypotheses)))
    assert causes[0].hypothesis.code == "RSEA_BACKLASH" and causes[0].probability > 0.99
    assert abs(causes[0].change - 4e-3) < 2e-4
    assert len(causes) == FINALISTS < len(hypotheses)
    counts = sorted(runs.count(float(look.t[0])) for look in looks)
    assert len(looks) == 4 and counts[0] == counts[2] < 0.5 * counts[3]
