"""Where the fit of a rival in a cause's place begins: guesses in, from trials and from the cause's size."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from scripted import script, unknown

from rsea_ros.diagnosis.backward_elimination import fitted_parameters
from rsea_ros.diagnosis.evaluation import trial_of
from rsea_ros.effects.catalogue import effect_named

FRICTION, STRIBECK, GAP = "coulomb_friction", "stribeck_friction", "backlash"
STOP, CUBIC, BASE = "hard_stop", "nonlinear_spring", "base_compliance"


@pytest.mark.parametrize(
    ("cause", "rival", "typical"),
    [(STRIBECK, FRICTION, {"torque"}), (STOP, CUBIC, None)],  # N m for N m; 1/rad^2 for rad
)
def test_a_rival_begins_with_the_size_of_the_cause_where_that_is_one(world, cause, rival, typical):
    scripted = world(script({"": 9.0, cause: 1.0, rival: 4.0}), rival)
    model = scripted.fits.candidate(cause)
    model.solution.theta[1:] = 0.75  # every parameter of the cause
    scripted.models.with_rivals(model)
    begun = scripted.guesses[rival]
    assert begun[0] == {"from": "residual"}
    if typical is None:
        assert len(begun) == 1
    else:
        assert begun[1:] == [{**effect_named(rival).typical, effect_named(rival).main.name: 0.75}]


@pytest.mark.parametrize(("beside", "is_used"), [((), True), ((GAP,), False)])
def test_a_rival_begins_where_its_trial_beside_the_same_causes_ended(world, beside, is_used):
    scripted = world(
        script({"": 9.0, STRIBECK: 1.0, FRICTION: 4.0, GAP: 5.0, f"{FRICTION}+{GAP}": 4.0}), FRICTION
    )
    tried = scripted.fits.candidate(*beside, FRICTION)
    tried.solution.theta[1:] = 0.5
    trial = trial_of(tried, FRICTION, scripted.fits.candidate(*beside), "explains_less")
    scripted.models.with_rivals(scripted.fits.candidate(STRIBECK), [trial])
    reached = {p.name: 0.5 for p in effect_named(FRICTION).parameters}
    assert scripted.guesses[FRICTION][0] == (reached if is_used else {"from": "residual"})


def test_a_rival_begins_where_the_latest_of_its_trials_ended(world):
    """The noise is estimated again after each step: the last trial has seen the least of other causes."""
    scripted = world(script({"": 9.0, STRIBECK: 1.0, FRICTION: 4.0}), FRICTION)
    trials = []
    for size in (0.25, 0.5):
        tried = scripted.fits.candidate(FRICTION)
        tried.solution.theta[1:] = size
        trials.append(trial_of(tried, FRICTION, scripted.fits.candidate(), "explains_less"))
    scripted.models.with_rivals(scripted.fits.candidate(STRIBECK), trials)
    assert set(scripted.guesses[FRICTION][0].values()) == {0.5}
    assert len(scripted.guesses[FRICTION]) == 2, "beside it only the size of the cause"


@pytest.mark.parametrize(
    ("effect", "parameter", "begins_with"),
    [
        (BASE, "stiffness", {"stiffness": 9.0, "spring.stiffness": 4.0}),  # two springs in series: both
        (FRICTION, "torque", {"torque": 9.0}),  # the rig's values are those of the fit
    ],
)
def test_only_a_mode_brings_the_rigs_values_along(effect, parameter, begins_with):
    names = ("spring.stiffness", "backlash.gap", f"{effect}.{parameter}")
    trial = SimpleNamespace(
        problem=SimpleNamespace(unknowns=tuple(map(unknown, names))), theta=(4.0, 0.01, 9.0)
    )
    assert fitted_parameters(trial, effect_named(effect)) == begins_with
