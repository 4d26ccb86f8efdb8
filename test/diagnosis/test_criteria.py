"""The criteria at their limits: scores whose ratios are exact in binary and lie exactly on a limit."""

from dataclasses import replace
from pathlib import Path

import pytest
from scripted_scores import Model, model, score

from rsea_ros.diagnosis import criteria
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.records.record import Fault


def settings(**acceptance):
    return replace(DEFAULT, acceptance=replace(DEFAULT.acceptance, **acceptance))


PAGE = Path(__file__).parents[2] / "docs" / "settings.md"
HALF = settings(matters=0.5)
RULE = settings(fall=0.5, fall_in_doubt=0.5, room=0.25)
A, B, C = "coulomb_friction", "backlash", "hard_stop"


@pytest.mark.parametrize(
    ("now", "before", "matters"),
    [
        (score(ft=1.0), score(ft=2.0), False),  # by half, and more than half is asked
        (score(ft=0.96875), score(ft=2.0), True),
        (score(ft=2.0, missed=0.25), score(ft=2.0, missed=0.5), False),
        (score(ft=2.0, missed=0.24), score(ft=2.0, missed=0.5), True),
        (score(ft=2.0, missed=0.0), score(ft=2.0, missed=0.0), False),  # none was missed
    ],
)
def test_a_gain_exactly_at_the_limit_does_not_matter(now, before, matters):
    assert criteria.preference(now, before, rule=HALF.acceptance).matters is matters


def test_better_means_sure_and_large_enough_to_matter():
    for now, better in ((1.9, False), (0.9, True), (4.0, False)):
        assert criteria.preference(score(ft=now), score(ft=2.0), rule=HALF.acceptance).better is better
    in_half_the_blocks = criteria.preference(score(ft=1.5, spread=1.0), score(ft=1.6, spread=-1.0), 1)
    assert (in_half_the_blocks.sure, in_half_the_blocks.matters) == (False, True)


def test_models_with_as_many_parameters_pay_nothing():
    now, before = score(ft=0.9999), score(ft=1.0)  # gains 0.8 of a loss of 4000
    assert criteria.preference(now, before).sure
    assert not criteria.preference(now, before, 1).sure


@pytest.mark.parametrize(
    ("candidate", "current", "reason"),
    [
        (model(A, ft=10.0), model(ft=20.0), "too_small"),  # half of a channel, and more is asked
        (model(A, ft=9.9375), model(ft=20.0), None),
        (model(A, B, ft=10.0), model(ft=20.0), "too_small"),  # half of the worst, for two at once
        (model(A, B, ft=9.9375), model(ft=20.0), None),
        (model(A, B, ft=9.0, position=16.0), model(ft=20.0, position=16.0), "too_small"),  # not of the worst
        (model(A, B, ft=9.0, position=16.0), model(A, ft=20.0, position=16.0), None),  # one more: of any
        (model(B, ft=9.0, position=16.0), model(A, ft=20.0, position=16.0), "too_small"),  # a replacement
        (model(A, B, C, ft=9.0, position=16.0), model(A, B, ft=20.0, position=16.0), "too_small"),
        (model(A, B, C, ft=1.0, position=4.9), model(A, B, ft=20.0, position=4.9), None),  # leaves little
        (model(A, ft=40.0), model(ft=20.0), "not_sure"),
        (model(A, ft=1.0, at_bound=True), model(ft=20.0), "at_bound"),
        (model(A, ft=20.0, position=1.0), model(ft=20.0, position=4.0), None),  # one channel is enough
    ],
)
def test_a_candidate_must_take_away_enough(candidate, current, reason):
    assert criteria.refusal(candidate, current, RULE) == reason


def test_a_model_at_the_noise_is_enough_whatever_it_gains():
    rule = replace(DEFAULT, floor=replace(DEFAULT.floor, only_noise=1.0))
    assert criteria.refusal(model(A, ft=0.96875), model(ft=1.03125), rule) is None
    assert criteria.refusal(model(A, ft=1.0), model(ft=1.046875), rule) == "too_small"


def test_a_cause_pays_for_its_own_parameters_alone():
    """It gains a loss of 8 over 40 samples: more than the price of one parameter, less than that of all."""
    now, before = score(samples=1.0, ft=1.2), score(samples=1.0, ft=1.5)
    gained = float((before.loss(before) - now.loss(before)).sum())
    assert 2.0 * 1 < gained < 2.0 * 13
    assert criteria.refusal(Model(now, (A,), parameters=7), Model(before, parameters=6)) is None


def test_among_equally_simple_models_loss_and_prior_count_alike():
    best = model(A, ft=1.0, prior_cost=1.5)
    other = model(B, ft=1.000125, prior_cost=1.0)  # loses 1.0 more
    assert criteria.break_tie([other, best], score(ft=9.0)) is best


@pytest.mark.parametrize(("prior_cost", "accepted"), [(1.9, "ft_bias"), (2.1, "ft_drift")])
def test_of_models_as_simple_an_optional_unknown_is_paid_for(prior_cost, accepted):
    bias, settling = model("ft_bias", prior_cost=prior_cost, ft=1.0), model("ft_drift", parameters=8, ft=1.0)
    assert criteria.break_tie([settling, bias], score(ft=20.0)).causes == (accepted,)
    assert criteria.break_tie([], score(ft=20.0)) is None


def test_a_larger_model_that_does_as_well_is_not_taken():
    small, large = model(A, ft=1.0, prior_cost=1.0), model(B, size=2, ft=1.0)
    assert criteria.break_tie([large, small], score(ft=9.0)) is small


def test_a_surely_worse_model_is_not_taken_near_the_floor_though_it_is_simpler():
    best, worse = model(A, size=3, ft=1.0), model(B, ft=1.5)
    assert criteria.break_tie([worse, best], score(ft=9.0)) is best


@pytest.mark.parametrize(
    ("simpler", "best", "nearly"),
    [
        (model(A, ft=11.9375), model(B, size=3, ft=8.0), True),  # two numbers saved: half as much again
        (model(A, ft=12.0), model(B, size=3, ft=8.0), False),
        (model(A, size=2, ft=9.9375), model(B, size=3, ft=8.0), True),
        (model(A, size=2, ft=10.0), model(B, size=3, ft=8.0), False),
        (model(A, ft=4.0), model(B, size=3, ft=4.0), False),  # near the floor
    ],
)
def test_a_simpler_model_is_nearly_as_good_within_its_allowance(simpler, best, nearly):
    assert criteria.is_nearly_as_good(simpler, best, RULE) is nearly


@pytest.mark.parametrize(("ratio", "equal"), [(4.0, True), (4.96875, True), (5.0, False), (40.0, False)])
def test_models_are_equally_good_within_the_allowance(ratio, equal):
    """25/16 of the loss are a quarter more of the residual."""
    assert criteria.is_equally_good(model(A, ft=ratio), model(B, ft=4.0), settings(room=0.5625)) is equal


@pytest.mark.parametrize(
    ("prior_cost", "ratio", "less"),
    [
        (1.0, 1.0, False),  # less by 1, and more is asked
        (0.96875, 1.0, True),
        (0.5, 1.0001, False),  # it loses 0.8 more
        (0.1, 1.0001, True),
        (1.5, 0.9999, True),  # and 0.8 less
    ],
)
def test_priors_decide_between_equal_models(prior_cost, ratio, less):
    other = model(A, ft=1.0, prior_cost=2.0)
    assert criteria.costs_priors_less(model(B, ft=ratio, prior_cost=prior_cost), other) is less


@pytest.mark.parametrize(("ratio", "far"), [(4.96875, False), (5.0, True), (6.0, True)])
def test_the_worst_channel_says_how_far_the_floor_is(ratio, far):
    far_model = model(ft=ratio, position=1.0)
    assert criteria.worst_ratio(far_model) == ratio
    assert criteria.is_far_from_floor(far_model) is far


FINE, BAD = score(ft=1.0, position=1.0), score(ft=1.0, position=9.0)
DEAD = Fault("dead_channel", "ft", 1.0)
LOST = Fault("frozen_samples", "ft", 0.1)


@pytest.mark.parametrize(
    ("scores", "statuses", "faults", "verdict"),
    [
        ([FINE], [], [], "nothing_wrong"),
        ([FINE], [], [LOST], "nothing_wrong"),
        ([FINE], [], [DEAD], "unexplained"),
        ([BAD], [], [], "unexplained"),
        ([BAD, FINE], [None], [], "unexplained"),
        ([FINE, BAD], [None], [], "nothing_wrong"),
        ([BAD, FINE], ["confirmed"], [], "explained"),
        ([BAD, FINE], ["confirmed"], [DEAD], "explained"),
        ([BAD, FINE], ["leading"], [], "partly_explained"),
        ([BAD, BAD], ["confirmed"], [], "partly_explained"),
        ([BAD, BAD, FINE], ["confirmed", "confirmed"], [], "explained"),
        ([BAD, BAD, FINE], ["leading", "confirmed"], [], "partly_explained"),
    ],
)
def test_the_verdict_follows_from_scores_statuses_and_faults(scores, statuses, faults, verdict):
    assert criteria.verdict_of(scores, statuses, faults=faults) == verdict


@pytest.mark.parametrize(
    ("ratios", "reached"),
    [
        ({"ft": 1.0, "position": 1.0}, True),
        ({"ft": 1.03125, "position": 1.0}, False),
        ({"ft": 0.5, "position": 1.03125}, False),
    ],
)
def test_every_channel_must_reach_the_floor(ratios, reached):
    assert criteria.is_at_floor(score(**ratios), replace(DEFAULT.floor, reached=1.0)) is reached


def test_every_setting_has_meaning_unit_and_reason_and_its_curve_on_the_page_that_it_points_to():
    settings = list(DEFAULT.numbers())
    assert len({s.name for s in settings}) == len(settings) < 40
    assert all(s.meaning and s.unit and s.reason for s in settings)
    sections = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    curves = {section.split("\n")[0]: section for section in sections}
    pointing = {s.name: s for s in settings if "docs/settings.md" in s.reason}
    assert curves.keys() == pointing.keys() and len(curves) == 8
    for name, setting in pointing.items():
        assert f"| **{setting.value:g}** |" in curves[name], name
        assert ("Flat:" in curves[name]) == setting.reason.startswith("flat"), name
