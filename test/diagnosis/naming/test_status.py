"""Which causes are named and with which status: the rules between probabilities and the verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rsea_ros.diagnosis.criteria import takes_most, verdict_of
from rsea_ros.diagnosis.naming.evidence import Evidence, Signature
from rsea_ros.diagnosis.naming.flexible import Flexible
from rsea_ros.diagnosis.naming.status import (
    COEFFICIENTS,
    features,
    probabilities_and_status,
    probability,
    status_of,
)
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT

SHARE = st.floats(0.0, 1.0)
SPREAD = st.floats(0.0, 10.0)
SIGNATURES = st.builds(Signature, *[SPREAD] * 4)
FLEXIBLE = st.none() | st.builds(Flexible, SHARE, st.tuples(st.floats(-1.0, 0.5), SHARE))
EVIDENCE = st.builds(
    Evidence,
    st.sampled_from(["coulomb_friction", "command_delay"]),
    SIGNATURES,
    FLEXIBLE,
    st.just("ft"),
    *[SHARE] * 2,
    st.booleans(),
    SHARE,
    st.floats(0.5, 1e3),
    st.booleans(),
)
RIGHT = Evidence(
    "command_delay", Signature(*[0.01] * 4), Flexible(0.0, (-0.01, 0.01)),
    "ft", 0.9, 0.88, True, 0.98, 1.0, False,
)  # fmt: skip


@given(st.lists(EVIDENCE, min_size=1, max_size=4), st.booleans(), st.booleans())
def test_a_cause_and_its_rivals_share_one_probability(evidence, at_floor, takes_most):
    likely, _ = probabilities_and_status(evidence, at_floor, takes_most)
    assert all(0.0 <= p <= 1.0 for p in likely)
    assert sum(likely) <= 1.0 + 1e-9


@given(SHARE, st.lists(st.floats(0.05, 0.5), max_size=2), st.booleans())
def test_only_what_is_likely_is_confirmed(p, rivals, at_floor):
    rule = DEFAULT.naming
    status = status_of(p, rivals, at_floor, rule)
    if status == "confirmed":
        assert p >= (rule.confirmed_at_floor if at_floor else rule.confirmed)
    if status == "one_of":
        assert rivals


@given(EVIDENCE)
def test_a_cause_that_the_data_speak_against_is_not_named(evidence):
    """Away from the floor, an effect that takes less than most must be probable and surely useful."""
    (p,), status = probabilities_and_status([evidence], at_floor=False, takes_most=False)
    brings = evidence.gain_low >= DEFAULT.acceptance.fall and not evidence.at_edge
    assert (status is None) == (not evidence.is_sure or p < (0.2 if brings else 0.5))


def test_evidence_against_a_law_lowers_its_probability():
    worse = {
        "signature": Signature(*[0.6] * 4),
        "flexible": Flexible(0.4, (0.3, 0.5)),
        "left": 20.0,
        "weight": 0.05,
    }
    for name, value in worse.items():
        assert probability(Evidence(**{**vars(RIGHT), name: value}), True) < probability(RIGHT, True), name
    assert set(features(RIGHT, True)) == set(COEFFICIENTS)


def test_the_floor_of_the_settings_is_the_floor_of_a_cause():
    """It was 1.1 times the noise, whatever `floor.reached` said."""
    near = replace(RIGHT, left=1.2)
    wider = replace(DEFAULT, floor=replace(DEFAULT.floor, reached=1.3))
    assert features(near, True)["noise"] == 0.0
    assert features(near, True, wider)["noise"] == 1.0


def score(**ratios):
    """Return the score of residuals that are so many times the noise, by channel."""
    counts = {n: np.full(4, 100.0) for n in ratios}
    return Score({n: np.full(4, 100.0 * r**2) for n, r in ratios.items()}, counts)


def test_a_verdict_is_explained_only_with_every_cause_confirmed_and_the_floor_reached():
    assert verdict_of([score(ft=9.0), score(ft=1.0)], ["confirmed"]) == "explained"
    assert verdict_of([score(ft=9.0), score(ft=1.0)], ["one_of"]) == "partly_explained"
    assert verdict_of([score(ft=9.0), score(ft=1.53)], ["confirmed"]) == "partly_explained"
    three = [score(ft=9.0), score(ft=5.0), score(ft=1.0)]
    assert verdict_of(three, ["confirmed", "leading"]) == "partly_explained"
    assert verdict_of([score(ft=9.0), score(ft=5.0)], [None]) == "unexplained"


def test_an_unchanged_channel_does_not_take_a_cause_away():
    """A rise from 1.53 to 1.5301 in one channel turned a gain of 0.92 into `unexplained`."""
    before = score(ft=40.0, position=1.53)
    assert takes_most(before, score(ft=1.2, position=1.5301))
    assert not takes_most(before, score(ft=1.2, position=1.6))


def test_a_cause_whose_misfit_lasts_from_block_to_block_is_not_confirmed():
    wandering = replace(RIGHT, signature=replace(RIGHT.signature, carried=4.0))
    _, right = probabilities_and_status([RIGHT], at_floor=True, takes_most=True)
    _, status = probabilities_and_status([wandering], at_floor=True, takes_most=True)
    assert (right, status) == ("confirmed", "leading")
