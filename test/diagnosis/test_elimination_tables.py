"""Backward elimination and its rivals as tables: residuals of models in; causes and reasons out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scripted
from scripted import POOLS, Script, script

from rsea_ros.diagnosis import stepwise as elimination
from rsea_ros.diagnosis.evaluation import Selection, trial_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.stepwise import ReducedModels, eliminate_backwards, nested_sequence
from rsea_ros.effects.catalogue import effect_named

FRICTION, STRIBECK, LUGRE = "coulomb_friction", "stribeck_friction", "lugre_friction"
GAP, STOP, CUBIC = "backlash", "hard_stop", "nonlinear_spring"
DELAY, LAG, BIAS = "command_delay", "current_loop_lag", "ft_bias"


class World:
    """Rivals and their fits from a script. guesses: by rival. impossible: rivals that the rig cannot have."""

    def __init__(self, monkeypatch, fits: Script, *effects):
        self.fits, self.guesses, self.impossible = fits, {}, set()
        self.models = ReducedModels([effect_named(n) for n in effects], POOLS, DEFAULT)
        monkeypatch.setattr(elimination.candidate, "fit_candidate", fits.fit)
        monkeypatch.setattr(elimination, "apply", lambda rig, unknowns, theta: (rig, None))
        monkeypatch.setattr(elimination, "view_for", lambda effect, cases, rig, outputs: None)
        monkeypatch.setattr(elimination, "initial_guesses", lambda effect, view: [{"from": "residual"}])
        monkeypatch.setattr(elimination, "in_exchange", lambda solution, name, rival: {"instead of": name})
        monkeypatch.setattr(elimination, "screen", self.screen)

    def screen(self, solution, rival, guesses):
        self.guesses[rival.name] = guesses
        if rival.name in self.impossible:
            return None
        made = scripted.problem(*solution.problem.added, rival.name)
        return SimpleNamespace(problem=made, theta=np.zeros(len(made.unknowns)), cost=-1.0)

    def eliminate(self, *causes):
        """Return the selection that is left of some causes."""
        selection = Selection((self.fits.candidate(), self.fits.candidate(*causes)))
        return eliminate_backwards(selection, self.models.effects, POOLS, DEFAULT)


@pytest.fixture
def world(monkeypatch):
    """Make a backward elimination on scripted fits, with some effects as rivals."""
    return lambda fits, *effects: World(monkeypatch, fits, *effects)


def reasons(selection):
    """The trials: cause, reason, rival."""
    return [(t.name, t.reason, t.rival) for t in selection.trials]


NEEDED = {"": 9.0, FRICTION: 4.0, GAP: 3.0, f"{FRICTION}+{GAP}": 1.0}


@pytest.mark.parametrize(
    ("ratios", "left", "gone"),
    [
        (NEEDED, [FRICTION, GAP], []),
        ({**NEEDED, GAP: 1.0}, [GAP], [FRICTION]),
        ({**NEEDED, FRICTION: 1.0}, [FRICTION], [GAP]),
        ({**NEEDED, FRICTION: 1.0, GAP: 1.0}, [GAP], [FRICTION]),  # one of two: the other is then alone
        ({**NEEDED, GAP: 0.5}, [GAP], [FRICTION]),  # better without it
    ],
)
def test_a_cause_that_the_others_make_redundant_goes(world, ratios, left, gone):
    selection = world(script(ratios)).eliminate(FRICTION, GAP)
    assert sorted(selection.last.causes) == sorted(left)
    assert reasons(selection) == [(name, "redundant", "") for name in gone]


@pytest.mark.parametrize(
    ("prior_without", "prior_with", "stays"),
    [(100.0, 1.0, True), (3.0, 1.0, False), (100.0, 99.0, False), (1.0, 100.0, False)],
)
def test_a_cause_stays_without_which_known_values_would_have_to_leave(
    world, prior_without, prior_with, stays
):
    """A resonance alone does as well as with the delay, but takes an inertia ten doubts off."""
    priors = {DELAY: prior_without, GAP: 1.0, f"{DELAY}+{GAP}": prior_with}
    ratios = {"": 9.0, DELAY: 4.0, GAP: 9.0, f"{DELAY}+{GAP}": 4.0}
    selection = world(script(ratios, priors)).eliminate(DELAY, GAP)
    assert (GAP in selection.last.causes) is stays


def test_an_only_cause_is_not_taken_out(world):
    scripted_run = world(script({"": 1.0, FRICTION: 1.0}))
    selection = scripted_run.eliminate(FRICTION)
    assert selection.last.causes == (FRICTION,)
    assert scripted_run.fits.log == [], "and no fit is spent on it"


def test_redundant_causes_go_one_after_the_other(world):
    ratios = {"": 9.0, FRICTION: 1.0, GAP: 9.0, DELAY: 9.0, f"{FRICTION}+{GAP}": 1.0}
    ratios |= {f"{FRICTION}+{DELAY}": 1.0, f"{GAP}+{DELAY}": 9.0, f"{FRICTION}+{GAP}+{DELAY}": 1.0}
    selection = world(script(ratios)).eliminate(FRICTION, GAP, DELAY)
    assert [m.causes for m in selection.models] == [(), (FRICTION,)]
    assert reasons(selection) == [(GAP, "redundant", ""), (DELAY, "redundant", "")]
    assert [t.beside.causes for t in selection.trials] == [(FRICTION, DELAY), (FRICTION,)]


SIMPLER = {"": 9.0, STRIBECK: 1.0, FRICTION: 1.0, "spring_hysteresis": 4.0}


@pytest.mark.parametrize(
    ("ratios", "left", "said"),
    [
        (SIMPLER, (FRICTION,), [(STRIBECK, "no_better_than_simpler", FRICTION)]),
        ({**SIMPLER, FRICTION: 2.0}, (STRIBECK,), []),
        ({**SIMPLER, FRICTION: 2.0, "spring_hysteresis": 1.0}, ("spring_hysteresis",),
         [(STRIBECK, "no_better_than_simpler", "spring_hysteresis")]),
    ],
)  # fmt: skip
def test_a_simpler_effect_that_does_as_well_takes_the_place(world, ratios, left, said):
    scripted_run = world(script(ratios), FRICTION, "spring_hysteresis", LUGRE, GAP)
    selection = scripted_run.eliminate(STRIBECK)
    assert selection.last.causes == left
    assert reasons(selection) == said
    assert LUGRE not in scripted_run.guesses, "what is larger is not tried"


def test_a_rival_that_the_rig_cannot_have_is_passed_over(world):
    scripted_run = world(script(SIMPLER), FRICTION, "spring_hysteresis")
    scripted_run.impossible = {FRICTION}
    assert scripted_run.eliminate(STRIBECK).last.causes == (STRIBECK,)


@pytest.mark.parametrize(
    ("ratio", "prior", "left"),
    [
        (1.0, 0.0, {GAP, LAG}),  # likelier by 4
        (1.0, 3.5, {GAP, DELAY}),  # by 0.5: not clearly
        (2.0, 0.0, {GAP, DELAY}),  # it does worse
    ],
)
def test_a_likelier_effect_as_simple_takes_the_place_beside_another_cause(world, ratio, prior, left):
    ratios = {"": 9.0, DELAY: 4.0, LAG: 4.0, GAP: 4.0, f"{DELAY}+{GAP}": 1.0, f"{LAG}+{GAP}": ratio}
    scripted_run = world(script(ratios, {f"{DELAY}+{GAP}": 4.0, f"{LAG}+{GAP}": prior}), LAG)
    selection = scripted_run.eliminate(DELAY, GAP)
    assert set(selection.last.causes) == left
    replaced = LAG in left
    assert reasons(selection) == [(DELAY, "no_better_than_likelier", LAG)] * replaced
    if not replaced:
        (rival,) = selection.contenders[DELAY]
        assert (rival.name, rival.beside.causes) == (LAG, (GAP,)), "what did not replace it stands against it"


@pytest.mark.parametrize("both", [5.0, 9.0])
def test_far_from_the_floor_priors_decide_nothing(world, both):
    ratios = {"": 90.0, DELAY: 40.0, LAG: 40.0, GAP: 40.0, f"{DELAY}+{GAP}": both, f"{LAG}+{GAP}": both}
    scripted_run = world(script(ratios, {f"{DELAY}+{GAP}": 9.0}), LAG)
    assert set(scripted_run.eliminate(DELAY, GAP).last.causes) == {DELAY, GAP}
    assert scripted_run.guesses == {}


def test_a_replacement_is_followed_by_the_next(world):
    """LuGre friction is replaced by Stribeck's, which is replaced by Coulomb's."""
    ratios = {"": 9.0, LUGRE: 1.0, STRIBECK: 1.0, FRICTION: 1.0}
    selection = world(script(ratios), STRIBECK, FRICTION).eliminate(LUGRE)
    assert reasons(selection) == [
        (LUGRE, "no_better_than_simpler", STRIBECK), (STRIBECK, "no_better_than_simpler", FRICTION)
    ]  # fmt: skip
    assert [m.causes for m in selection.models] == [(), (FRICTION,)]


def test_models_nest_from_the_most_useful_cause_on(world):
    ratios = {"": 9.0, FRICTION: 6.0, GAP: 5.0, DELAY: 7.0, f"{FRICTION}+{GAP}": 4.0}
    ratios |= {f"{FRICTION}+{DELAY}": 2.0, f"{GAP}+{DELAY}": 3.0, f"{FRICTION}+{GAP}+{DELAY}": 1.0}
    scripted_run = world(script(ratios))
    full = scripted_run.fits.candidate(GAP, FRICTION, DELAY)
    nested = nested_sequence(Selection((scripted_run.fits.candidate(), full)), scripted_run.models)
    assert [m.causes for m in nested.models] == [(), (FRICTION,), (FRICTION, DELAY), (FRICTION, DELAY, GAP)]
    assert [m.validation.ratio("ft") for m in nested.models] == [9.0, 6.0, 2.0, 1.0]


def test_a_cause_that_keeps_known_values_is_more_useful_than_one_that_explains_as_much(world):
    """A mode stood first, and the delay beside it gained nothing more; alone it needed another inertia."""
    ratios = {"": 9.0, FRICTION: 5.001, GAP: 5.0, f"{FRICTION}+{GAP}": 1.0}
    scripted_run = world(script(ratios, {GAP: 110.0, FRICTION: 25.0}))
    full = scripted_run.fits.candidate(GAP, FRICTION)
    nested = nested_sequence(Selection((scripted_run.fits.candidate(), full)), scripted_run.models)
    assert [m.causes for m in nested.models] == [(), (FRICTION,), (FRICTION, GAP)]


def test_effects_that_the_rig_states_come_first_and_are_never_causes(world):
    scripted_run = world(script({"": 9.0, FRICTION: 6.0, GAP: 5.0, f"{FRICTION}+{GAP}": 1.0}))
    full = scripted_run.fits.candidate(FRICTION, GAP, stated=(BIAS, DELAY))
    nested = nested_sequence(
        Selection((scripted_run.fits.candidate(stated=(BIAS, DELAY)), full)), scripted_run.models
    )
    assert [m.problem.acting for m in nested.models] == [
        (BIAS, DELAY), (BIAS, DELAY, GAP), (BIAS, DELAY, GAP, FRICTION)
    ]  # fmt: skip


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
        assert begun[1:] == [], "of an angle without end there is no size to take over"
    else:
        same = {**effect_named(rival).typical, effect_named(rival).main.name: 0.75}
        assert begun[1:] == [same, {"instead of": cause}]


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
    assert len(scripted.guesses[FRICTION]) == 3, "beside it the size of the cause, and the exchange"


@pytest.mark.parametrize(("is_full", "causes"), [(True, (DELAY,)), (False, (STRIBECK,))])
def test_what_was_fitted_at_some_step_is_tried_in_the_place_of_a_cause_listed_or_not(world, is_full, causes):
    """A mode above the band was "confirmed" for an F/T sensor that is read late, which nobody had listed."""
    scripted = world(script({"": 9.0, GAP: 5.0, STRIBECK: 1.0, DELAY: 1.0}), DELAY)
    tried = trial_of(scripted.fits.candidate(DELAY), DELAY, scripted.fits.candidate(GAP), "explains_less")
    models = (scripted.fits.candidate(), scripted.fits.candidate(STRIBECK))
    trials = (replace(tried, is_full=is_full),)
    left = eliminate_backwards(Selection(models, trials), scripted.models.effects, POOLS, DEFAULT)
    assert left.last.causes == causes
