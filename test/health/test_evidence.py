"""A block gives the innovations of the observer, and the evidence of a look gives the change behind it."""

import numpy as np
import pytest

from rsea_ros.health.hypotheses import Bank, Cutter, hypotheses_of
from rsea_ros.health.recursive_estimates import Estimates
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
    one = Observer(RIG, hold=0.05)
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
