"""Stepwise selection as tables: the steps of a search, and where it ends."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import scripted
from scripted import POOLS, script, settings

from rsea_ros.diagnosis import diagnose as diagnosing, stepwise
from rsea_ros.diagnosis.evaluation import trial_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.stepwise import StepResult, select_stepwise
from rsea_ros.effects.catalogue import effect_named

FRICTION, HYSTERESIS = "coulomb_friction", "spring_hysteresis"
GAP, DELAY, LAG = "backlash", "command_delay", "current_loop_lag"
OTHERS = [effect_named(n) for n in (FRICTION, GAP, DELAY)]


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
            "where_it_begins": lambda model, setup: model,
            "rescore": self.scored,
            "leaves_only_noise": lambda model, limit: model.validation.ratio("ft") < limit,
            "vector_of": lambda unknowns, start: (unknowns, start),
        }.items():
            monkeypatch.setattr(stepwise if hasattr(stepwise, name) else stepwise.candidate, name, stand_in)

    def refit(self, model, setup):
        assert setup.cases in (self.nominal.cases, self.fits.cases) and setup.iterations == 12
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


@pytest.mark.parametrize(
    ("left", "gone_on", "end"),
    [
        ({"ab": "ab"}, {}, "ab"),  # nothing to take away
        ({"ab": "b"}, {"b": "b"}, "b"),  # and nothing helps instead
        ({"ab": "b", "bcd": "cd"}, {"b": "bcd", "cd": "cd"}, "cd"),  # a cause that came in for two made room
        ({"ab": "b", "bc": "bc"}, {"b": "bc"}, "bc"),
        ({"ab": "b", "ba": "b"}, {"b": "ba"}, "b"),  # for ever in a circle
    ],
)
def test_a_search_goes_on_from_what_is_left_until_no_cause_comes_or_goes(monkeypatch, left, gone_on, end):
    """Gear loss came in for a wrong constant, a soft base and friction, went, and nothing followed it."""
    selection = lambda names: SimpleNamespace(last=SimpleNamespace(causes=tuple(names)))  # noqa: E731
    taken = lambda steps: lambda given, *_: selection(steps["".join(given.last.causes)])  # noqa: E731
    monkeypatch.setattr(diagnosing, "eliminate_backwards", taken(left))
    monkeypatch.setattr(diagnosing, "go_on", taken(gone_on))
    found = diagnosing.settled(selection("ab"), (), POOLS, None, DEFAULT)
    assert "".join(found.last.causes) == end
