"""Stepwise selection as tables: the steps of a search, where it ends, the gain that a replacement needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import scripted
from scripted import POOLS, script, settings

from rsea_ros.diagnosis import stepwise
from rsea_ros.diagnosis.evaluation import trial_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.stepwise import NO_STEP, StepResult, replacement_step, select_stepwise
from rsea_ros.effects.catalogue import effect_named

FRICTION, STRIBECK, LUGRE, HYSTERESIS = (
    "coulomb_friction", "stribeck_friction", "lugre_friction", "spring_hysteresis"
)  # fmt: skip
GAP, STOP, DELAY, LAG = "backlash", "hard_stop", "command_delay", "current_loop_lag"
OTHERS = [effect_named(n) for n in (FRICTION, STRIBECK, LUGRE, GAP, STOP, DELAY)]


@dataclass(frozen=True)
class Step:
    """A forward step by a script. steps: by current causes the causes that it accepts, None for none."""

    current: object
    effects: object
    number: int
    pools: object
    tell: object
    settings: object

    def run(self):
        world = World.now
        world.runs.append((self.number, self.current.causes, tuple(e.name for e in self.effects)))
        accepted = world.steps.get(self.current.causes)
        tried = [trial_of(self.current, "dead_zone", self.current, "not_sure")]
        if accepted is None:
            return StepResult(None, tried)
        return StepResult(world.fits.candidate(*accepted), tried)


class World:
    """Stepwise selection on scripted fits and steps. events: what happened to each model after its fit."""

    now: World

    def __init__(self, monkeypatch, fits, steps):
        World.now = self
        self.fits, self.steps, self.runs, self.events = fits, steps, [], []
        self.theta = np.zeros(1)
        for name, stand_in in {
            "fit_candidate": fits.fit,
            "ForwardStep": Step,
            "refit": self.refit,
            "with_noise_reestimated": self.reestimate_noise,
            "on_fine_steps": lambda model, setup: model,
            "rescore": self.scored,
            "leaves_only_noise": lambda model, limit: model.validation.ratio("ft") < limit,
            "vector_of": lambda unknowns, start: (unknowns, start),
        }.items():
            monkeypatch.setattr(stepwise, name, stand_in)

    def refit(self, model, setup):
        assert setup.cases == self.nominal.cases and setup.iterations is None
        self.events.append(("refit", model.causes))
        return model

    def reestimate_noise(self, model):
        self.events.append(("noise", model.causes))
        return model

    def scored(self, model, cases):
        self.events.append(("scored", model.causes))
        assert cases == self.fits.cases
        return replace(model, outputs=[{"scored": True}])

    def select(self, rule=DEFAULT, start=None):
        self.nominal = scripted.problem()
        return select_stepwise(self.nominal, OTHERS, POOLS, lambda what, share: None, rule, start)


@pytest.fixture
def world(monkeypatch):
    return lambda fits, steps=None: World(monkeypatch, fits, steps or {})


def causes(selection):
    return [m.causes for m in selection.models]


BOTH = {"": 9.0, FRICTION: 4.0, f"{FRICTION}+{GAP}": 1.0, LAG: 5.0}
ALONG = {(): (FRICTION,), (FRICTION,): (FRICTION, GAP)}


@pytest.mark.parametrize(
    ("ratios", "steps", "models"),
    [
        ({"": 1.0}, ALONG, [()]),  # only noise from the first on
        ({**BOTH, FRICTION: 1.03}, ALONG, [(), (FRICTION,)]),  # only noise with one cause
        (BOTH, {}, [()]),  # no effect helps
        (BOTH, {(): (FRICTION,)}, [(), (FRICTION,)]),
        (BOTH, ALONG, [(), (FRICTION,), (FRICTION, GAP)]),
    ],
)
def test_a_search_goes_on_until_only_noise_is_left_or_nothing_helps(world, ratios, steps, models):
    assert causes(world(script(ratios), steps).select()) == models


def test_coloured_noise_may_hide_a_cause(world):
    coloured = (SimpleNamespace(coloured=frozenset()), SimpleNamespace(coloured=frozenset({"ft"})))
    fits = script({"": 1.0, FRICTION: 0.9, LAG: 1.0}, cases=coloured)
    assert causes(world(fits, {(): (FRICTION,)}).select()) == [(), (FRICTION,)]


@pytest.mark.parametrize("most", [1, 2])
def test_no_more_causes_are_accepted_than_max_causes(world, most):
    ratios = {**BOTH, f"{FRICTION}+{GAP}": 3.0, f"{FRICTION}+{GAP}+{DELAY}": 1.0}
    search = world(script(ratios), {**ALONG, (FRICTION, GAP): (FRICTION, GAP, DELAY)})
    assert (
        causes(search.select(settings(max_causes=most)))
        == [(), (FRICTION,), (FRICTION, GAP)][: most + 1]
    )
    assert len(search.runs) == most, "no more is tried than may be accepted"


@pytest.mark.parametrize(("replacements", "last"), [(0, (FRICTION,)), (1, (STRIBECK,)), (2, (LUGRE,))])
def test_no_more_replacements_are_made_than_allowed(world, monkeypatch, replacements, last):
    search = world(
        script({"": 90.0, FRICTION: 60.0, STRIBECK: 30.0, LUGRE: 10.0, LAG: 50.0}), {(): (FRICTION,)}
    )
    following = {(FRICTION,): (STRIBECK,), (STRIBECK,): (LUGRE,), (LUGRE,): (FRICTION,)}

    def replace_step(step):
        name = following[step.current.causes]
        return StepResult(search.fits.candidate(*name), [])

    monkeypatch.setattr(stepwise, "replacement_step", replace_step)
    selection = search.select(settings(max_causes=1, replacements=replacements))
    assert selection.last.causes == last


def test_trials_are_kept(world):
    selection = world(script(BOTH), ALONG).select()
    assert [(t.name, t.beside.causes, t.reason) for t in selection.trials] == [
        ("dead_zone", (), "not_sure"),
        (FRICTION, (), "replaced"),
        ("dead_zone", (FRICTION,), "not_sure"),
        (GAP, (FRICTION,), "replaced"),
    ]


def test_every_model_is_fitted_again_in_its_noise_and_all_are_scored_in_that_of_the_last(world):
    search = world(script(BOTH), ALONG)
    selection = search.select()
    each = [(what, c) for c in ((), (FRICTION,), (FRICTION, GAP)) for what in ("noise", "refit")]
    assert search.events == [*each, ("scored", ()), ("scored", (FRICTION,))]
    assert [m.outputs for m in selection.models] == [[{"scored": True}]] * 2 + [[{}]]


def replacement(search, *current, effects=OTHERS):
    """The causes of the model that a replacement leads to; None for none."""
    step = Step(search.fits.candidate(*current), effects, 7, POOLS, None, DEFAULT)
    result = replacement_step(step)
    return None if result is NO_STEP else result.accepted.causes


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (20.0, 13.5, (STRIBECK,)),  # 30 % less, as one in another's place must bring
        (20.0, 14.5, None),
        (5.0, 1.0, (STRIBECK,)),
        (4.9, 1.0, None),  # near the floor nothing is replaced
    ],
)
def test_a_more_detailed_effect_replaces_a_cause_where_it_gains_enough(world, before, after, expected):
    search = world(script({"": 40.0, FRICTION: before, STRIBECK: after, LAG: 9.0}), {(): (STRIBECK,)})
    assert replacement(search, FRICTION) == expected
    tried = [(7, (), (STRIBECK, LUGRE))] if before >= 5.0 else []
    assert search.runs == tried, "its look-alikes that say more than it does, and no others"
    assert search.fits.log == [((), True)] * len(tried)
    for setup, _ in search.fits.setups:
        assert setup.weights.ratio("ft") == before and setup.cases == search.fits.cases


@pytest.mark.parametrize("first", [None, (STRIBECK, GAP)])
def test_the_next_place_is_tried_where_one_brings_nothing(world, first):
    """Delay has no rival here; Stribeck friction in place of friction gains too little; a stop helps."""
    ratios = {"": 99.0, f"{DELAY}+{FRICTION}+{GAP}": 20.0, f"{DELAY}+{FRICTION}": 50.0, LAG: 9.0}
    ratios |= {f"{DELAY}+{GAP}": 50.0, f"{STRIBECK}+{GAP}": 19.0, f"{DELAY}+{FRICTION}+{STOP}": 9.0}
    steps = {(DELAY, GAP): first, (DELAY, FRICTION): (DELAY, FRICTION, STOP)}
    search = world(script(ratios), steps)
    assert replacement(search, DELAY, FRICTION, GAP) == (DELAY, FRICTION, STOP)
    assert [(current, names) for _, current, names in search.runs] == [
        ((DELAY, GAP), (STRIBECK, LUGRE)), ((DELAY, FRICTION), (STOP,))
    ]  # fmt: skip
