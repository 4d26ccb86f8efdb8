"""What a model pays for values outside the doubt that the rig states, against what it gains."""

from __future__ import annotations

import pytest
from scripted_scores import model

from rsea_ros.diagnosis.criteria import break_tie, refusal

FRICTION, GAP, STOP = "coulomb_friction", "backlash", "hard_stop"
GAIN = 40 * 100 * (1.0 - 0.25)
"""Twice the log of the odds that half of the residual is worth: 40 blocks of 100 samples of white noise."""


@pytest.mark.parametrize(
    ("prior_cost", "reason"),
    [(0.0, None), (GAIN - 0.5, None), (GAIN, None), (GAIN + 0.5, "leaves_priors")],
)
def test_a_cause_is_refused_once_its_values_are_less_likely_than_its_gain_is_worth(prior_cost, reason):
    assert refusal(model(FRICTION, ft=2.0, prior_cost=prior_cost), model(ft=4.0)) == reason


def test_a_third_model_that_fits_badly_does_not_change_the_choice_between_two():
    """A loss in units of a large residual is small: known values would outweigh it."""
    better, likelier = model(FRICTION, ft=1.0, prior_cost=2000.0), model(GAP, ft=2.0)
    current, poor = model(ft=8.0), model(STOP, ft=4.0)
    assert break_tie([better, likelier], current.validation) == (better, ())
    assert break_tie([better, likelier, poor], current.validation) == (better, ())
