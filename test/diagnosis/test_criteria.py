"""The acceptance rule as a table: scores in, decision out; no fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rsea_ros.diagnosis.criteria import (
    break_tie,
    costs_priors_less,
    is_equally_good,
    is_far_from_floor,
    is_nearly_as_good,
    preference,
    refusal,
)
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT

BLOCKS, SAMPLES = 40, 100.0


def score(missed=0.0, spread=0.0, **ratios):
    """Return a score with the same residual over the noise in all blocks, or alternating by `spread`."""
    wave = 1.0 + spread * np.resize([1.0, -1.0], BLOCKS)
    sums = {n: SAMPLES * r**2 * wave for n, r in ratios.items()}
    return Score(sums, {n: np.full(BLOCKS, SAMPLES) for n in ratios}, missed)


@dataclass(frozen=True)
class Model:
    """The part of a candidate that the criteria use."""

    validation: Score
    causes: tuple[str, ...] = ()
    parameters: int = 6
    size: int = 0
    prior_cost: float = 0.0
    is_at_bound: bool = False


def model(*causes, size=1, parameters=None, prior_cost=0.0, at_bound=False, **ratios):
    count = 6 + len(causes) if parameters is None else parameters
    return Model(score(**ratios), causes, count, size * len(causes), prior_cost, at_bound)


@pytest.mark.parametrize(
    ("now", "before", "extra", "sure", "matters"),
    [
        (score(ft=1.0), score(ft=2.0), 1, True, True),
        (score(ft=2.0), score(ft=1.0), 1, False, False),
        (score(ft=1.97), score(ft=2.0), 1, True, False),  # 1.5 % of one channel does not matter
        (score(ft=1.95), score(ft=2.0), 1, True, True),
        (score(ft=1.97, missed=0.1), score(ft=2.0, missed=0.5), 1, True, True),  # a response no longer missed
        (score(ft=1.97, missed=0.25), score(ft=2.0, missed=0.5), 1, True, False),  # half of it is not enough
        (score(ft=1.9, position=1.0), score(ft=2.0, position=1.0), 1, True, True),  # one channel is enough
        (score(ft=1.0, position=1.0), score(ft=1.0, position=1.0), 0, False, False),
        (score(ft=1.5, spread=1.0), score(ft=1.6, spread=-1.0), 1, False, True),  # better in half the blocks
    ],
)
def test_a_model_is_preferred_when_it_is_surely_better_and_that_matters(now, before, extra, sure, matters):
    choice = preference(now, before, extra)
    assert (choice.sure, choice.matters, choice.better) == (sure, matters, sure and matters)


def test_each_parameter_must_bring_what_a_useless_one_gains():
    now, before = score(ft=0.99), score(ft=1.0)
    gained = float((before.loss(before) - now.loss(before)).sum())
    assert preference(now, before, int(gained / 2.0)).sure
    assert not preference(now, before, int(gained / 2.0) + 1).sure


FRICTION, GAP = "coulomb_friction", "backlash"


@pytest.mark.parametrize(
    ("candidate", "current", "reason"),
    [
        (model(GAP, ft=1.0), model(ft=20.0), None),
        (model(GAP, ft=1.0, at_bound=True), model(ft=20.0), "at_bound"),
        (model(GAP, ft=20.0), model(ft=20.0), "not_sure"),
        (model(GAP, ft=19.8), model(ft=20.0), "too_small"),  # sure, but 1 %
        (model(GAP, ft=19.1), model(ft=20.0), "too_small"),  # 4.5 % of a channel
        (model(GAP, ft=18.9), model(ft=20.0), None),
        (model(GAP, ft=1.02), model(ft=1.08), None),  # all that was left
        (model(GAP, ft=1.05), model(ft=1.1), "too_small"),
        # one channel is enough for one more cause
        (model(GAP, ft=20.0, position=1.0), model(ft=20.0, position=4.0), None),
        # two at once must take 30 % of the worst channel
        (model(FRICTION, GAP, ft=14.5), model(ft=20.0), "too_small"),
        (model(FRICTION, GAP, ft=13.5), model(ft=20.0), None),
        # another in the place of one too
        (model(GAP, ft=14.5), model(FRICTION, ft=20.0), "too_small"),
        (model(GAP, ft=13.5), model(FRICTION, ft=20.0), None),
        # and a third that leaves much, not one that leaves little
        (model(FRICTION, GAP, "hard_stop", ft=14.5), model(FRICTION, GAP, ft=20.0), "too_small"),
        (model(FRICTION, GAP, "hard_stop", ft=4.9), model(FRICTION, GAP, ft=5.5), None),
        (model(FRICTION, GAP, "hard_stop", ft=5.0), model(FRICTION, GAP, ft=5.6), "too_small"),
    ],
)
def test_a_candidate_is_refused_for_a_reason(candidate, current, reason):
    assert refusal(candidate, current) == reason


def test_of_equal_models_the_simplest_is_accepted_and_those_as_simple_are_its_rivals():
    current = score(ft=20.0)
    simple = model(FRICTION, ft=1.0, prior_cost=3.0)
    likelier = model(GAP, ft=1.0, prior_cost=1.0)
    larger = model("stribeck_friction", size=3, parameters=9, ft=1.0)
    worse = model("hard_stop", ft=1.5)
    assert break_tie([simple, larger, likelier, worse], current) == (likelier, (simple,))
    assert break_tie([larger], current) == (larger, ())
    assert break_tie([], current) == (None, ())


@pytest.mark.parametrize(("prior_cost", "accepted"), [(1.0, "ft_bias"), (1.9, "ft_bias"), (2.1, "ft_drift")])
def test_of_models_as_simple_an_optional_unknown_is_paid_for(prior_cost, accepted):
    current = score(ft=20.0)
    bias = model("ft_bias", parameters=7, prior_cost=prior_cost, ft=1.0)
    settling = model("ft_drift", parameters=8, ft=1.0)
    assert break_tie([settling, bias], current)[0].causes == (accepted,)


def test_far_from_the_floor_a_simpler_model_may_leave_a_tenth_more_for_each_number_it_saves():
    best = model("stribeck_friction", size=3, ft=20.0)
    assert is_nearly_as_good(model(FRICTION, ft=23.9), best)
    assert not is_nearly_as_good(model(FRICTION, ft=24.1), best)
    assert not is_nearly_as_good(model(FRICTION, ft=4.9), model("stribeck_friction", size=3, ft=4.8))


def test_a_tenth_more_loss_is_equally_good():
    assert is_equally_good(model(GAP, ft=2.09), model(FRICTION, ft=2.0))
    assert not is_equally_good(model(GAP, ft=2.11), model(FRICTION, ft=2.0))


def test_priors_decide_from_a_difference_of_one():
    other = model(FRICTION, ft=1.0, prior_cost=2.0)
    assert costs_priors_less(model(GAP, ft=1.0, prior_cost=0.9), other)
    assert not costs_priors_less(model(GAP, ft=1.0, prior_cost=1.1), other)


def test_far_is_five_times_the_noise_in_the_worst_channel():
    assert is_far_from_floor(model(ft=1.0, position=5.0))
    assert not is_far_from_floor(model(ft=1.0, position=4.99))


def test_the_settings_steer_the_decision():
    strict = replace(DEFAULT, acceptance=replace(DEFAULT.acceptance, fall=0.96))
    assert refusal(model(GAP, ft=2.0), model(ft=20.0)) is None
    assert refusal(model(GAP, ft=2.0), model(ft=20.0), strict) == "too_small"


def test_every_setting_has_meaning_unit_and_reason():
    settings = list(DEFAULT.numbers())
    assert len({s.name for s in settings}) == len(settings) > 35
    assert all(s.meaning and s.unit and s.reason for s in settings)
