"""What a model pays for values outside the doubt that the rig states, against what it gains."""

from __future__ import annotations

import numpy as np
import pytest
from scripted_scores import model

from rsea_ros.diagnosis.criteria import break_tie, refusal
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, chirp
from rsea_ros.identification.unknowns import with_effect
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

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


@pytest.mark.parametrize(
    ("name", "value", "cause", "rival"),
    [
        ("spring.stiffness", 1.6, "ft_gain_error", "torque_constant_error"),
        ("rotor.reflected_inertia", 0.2, "torque_constant_error", "ft_gain_error"),
    ],
)
def test_a_rig_that_is_wrong_decides_between_no_two_causes(name, value, cause, rival):
    """A wrong motor constant and a wrong gain differ by the rig's values alone, and one of these is off."""
    stated = load_rig("paper_high_impedance")
    truth = with_effect(stated.with_values({name: value * stated[name]}), cause, {"gain": 0.88})
    asked = ExcitationSettings(rate=280.0, duration=20.0, amplitude=15.0, noise=0.3, low=0.1, high=60.0)
    command = chirp(asked)
    record = synthesize(truth, Channel(np.arange(len(command)) / 280.0, command), seed=7)
    tried = {cause, rival, "current_loop_lag", "coulomb_friction"}
    found = diagnose([record], stated, settings=DiagnosisSettings(without=frozenset(catalogue()) - tried))
    (named,) = found.causes
    assert named.status == "one_of"
    assert {named.name, *(a.name for a in found.alternatives)} == {cause, rival}
