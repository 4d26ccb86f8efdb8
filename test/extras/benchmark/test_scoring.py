"""Scores of answers, against values worked out by hand."""

from __future__ import annotations

import math

import pytest

from rsea_extras.benchmark.dataset import Answer
from rsea_extras.benchmark.scoring import RecordTruth, score, truth_hash

EFFECTS = ("a", "b", "c", "d")


def truth_of(*names, outside=""):
    return RecordTruth({n: {"size": 1.0} for n in names}, outside, dict.fromkeys(names, 2.0), "salt")


def test_scores_by_hand():
    truths = {"r0001": truth_of("a", "b"), "r0002": truth_of(outside="x"), "r0003": truth_of("c")}
    answers = {
        "r0001": Answer({"a": 0.8, "c": 0.6, "b": 0.2}),
        "r0002": Answer({"d": 0.4}),
        "r0003": Answer({"d": 0.5}),
    }
    scores = score(answers, truths, EFFECTS)
    assert scores.named_right.value == pytest.approx(1 / 3)
    assert scores.false_names.value == pytest.approx(2 / 3)
    assert scores.silent.value == 1.0
    brier = (0.2**2 + 0.6**2 + 0.8**2) + 0.4**2 + (0.5**2 + 1.0)
    assert scores.brier.value == pytest.approx(brier / 3)
    # a is first, b behind c; c of the last record shares 0 with a and b, behind d: 1 + 1 + 2 / 2
    assert scores.rank.value == 2.0
    assert scores.answered == pytest.approx(2 / 3)


def test_a_second_right_cause_is_no_rival_of_the_first():
    scores = score({"r0001": Answer({"a": 0.9, "b": 0.8})}, {"r0001": truth_of("a", "b")}, EFFECTS)
    assert scores.rank == (1.0, 1.0, 1.0)


def test_names_in_a_record_that_hides_nothing_of_the_list_are_false():
    scores = score({"r0001": Answer({"a": 0.5})}, {"r0001": truth_of(outside="x")}, EFFECTS)
    assert scores.silent.value == 0.0 and scores.false_names.value == 1.0
    assert math.isnan(scores.named_right.value) and math.isnan(scores.rank.value)


def test_the_interval_narrows_with_the_records():
    def width(count):
        truths = {f"r{k}": truth_of("a") for k in range(count)}
        answers = {f"r{k}": Answer({"a": 1.0} if k % 2 else {}) for k in range(count)}
        interval = score(answers, truths, EFFECTS).named_right
        assert interval.low < interval.value == 0.5 < interval.high
        return interval.high - interval.low

    assert width(64) == pytest.approx(0.5 * width(16), rel=0.15)


def test_a_hash_depends_on_every_part_of_the_truth():
    truth = truth_of("a")
    salted = RecordTruth(truth.causes, "", truth.times_noise, "pepper")
    others = (truth_of("b"), truth_of("a", outside="x"), salted)
    hashes = [truth_hash("r0001", t) for t in (truth, *others)] + [truth_hash("r0002", truth)]
    assert len(set(hashes)) == 5
