"""A cause that another contains is confirmed only after a run that could have shown the other."""

import itertools
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent.bench import Bench, record_command
from independent.hidden import hide
from slow_work import ASKED, CAUSES, RIG

from rsea_ros.experiment import campaign, campaign as shared_name
from rsea_ros.experiment.campaign import Campaign, SharedName
from rsea_ros.experiment.joint_weighing import weigh
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import RunLimits
from rsea_ros.report.experiment import end_sentence, shared_words

FRICTION = ("coulomb_friction", "stribeck_friction")
STUCK = {"coulomb_torque": 0.8, "stribeck_torque": 0.7, "stribeck_velocity": 0.05}


@dataclass(frozen=True)
class Held:
    """What the loop reads of a hypothesis."""

    name: str
    probability: float
    addition: int | None = None

    def beside(self, simpler):
        return self


@dataclass(frozen=True)
class Known:
    """What the loop reads of a weighing in which a richer cause fits as well as the best.

    added: the index of what the richer one has more, None where it has nothing that was seen.
    """

    best: str = "current_loop_lag"
    richer: str = "hard_stop"
    added: int | None = None
    left: float = 1.0
    cases: tuple = (SimpleNamespace(noise={}),)

    @property
    def probability(self):
        return {self.best: 0.97, self.richer: 0.03}

    def hypotheses(self, least=0.0):
        every = (Held(self.best, 0.97), Held(self.richer, 0.03, self.added))
        return [h for h in every if h.probability >= least or self.added is not None]

    def near_by_data(self, least, richer=False):
        return [self.richer] if richer else []


def test_a_name_waits_for_the_run_that_may_show_a_richer_cause(log, proposal):
    tried = replace(proposal, names=("current_loop_lag", "hard_stop"), chances=(0.0, 0.1))
    asked = []
    work = Campaign(RIG, CAUSES, ASKED, lambda _: None, choose=lambda _, a, *__: asked.append(a) or tried)
    assert work.go([log], Known()).end == "declined"
    assert asked[0].test == work.rules.shown, "designed to separate what is as good as known"


@pytest.mark.parametrize(("chance", "runs"), [(0.0, 0), (0.1, 1)])
def test_a_name_is_shared_where_no_run_would_show_a_richer_cause(log, proposal, monkeypatch, chance, runs):
    weighing = Known(*FRICTION, added=5)  # too little motion to show which friction it is
    tried = replace(proposal, names=FRICTION, chances=(0.0, chance), duration=2.0, hopeless=())
    monkeypatch.setattr(campaign, "weigh", lambda *_: weighing)
    monkeypatch.setattr(shared_name, "torque_that_shows", lambda *_: 2.5)
    monkeypatch.setattr(campaign, "proofs_of", lambda *_: ())
    outcome = Campaign(RIG, FRICTION, ASKED, lambda _: log, choose=lambda *_: tried).go([log], weighing)
    assert (outcome.end, len(outcome.rounds) - 1) == ("undecidable", runs)
    assert outcome.shared == SharedName(FRICTION, 2.5)
    sentence = end_sentence(outcome)
    assert sentence.startswith("Coulomb friction (0.97) or Stribeck friction (0.03): no run within the")
    assert sentence.endswith("; it takes at least about 2.5 N·m")
    unknown = replace(outcome, shared=SharedName(FRICTION, None))
    assert shared_words(unknown).endswith("within the limits shows which")


def test_a_richer_cause_is_tested_once(log, proposal, monkeypatch):
    tried = replace(proposal, names=("current_loop_lag", "hard_stop"), chances=(0.0, 0.9))
    monkeypatch.setattr(campaign, "weigh", lambda *_: Known())
    outcome = Campaign(RIG, CAUSES, ASKED, lambda _: log, choose=lambda *_: tried).go([log], Known())
    assert outcome.end == "confirmed" and len(outcome.rounds) == 2


@pytest.fixture(scope="module")
def stuck():
    """Return the weighing of friction by slow work in which the joint stays stuck."""
    bench = hide(Bench(), "stribeck_friction", STUCK)
    t = np.arange(10 * 280) / 280.0
    return weigh([record_command(bench, 0.5 * np.sin(1.6 * t), np.random.default_rng(4))], RIG, FRICTION)


def test_a_cause_that_contains_another_fits_no_worse(stuck):
    simple, rich = (stuck.fits[n] for n in FRICTION)
    assert rich.cost < simple.cost + 2.0, "a local minimum"
    assert stuck.probability["coulomb_friction"] < 0.95, "confirmed by what slow work cannot show"


def test_what_a_richer_cause_adds_is_rated_within_what_is_known(stuck):
    rich = next(h for h in stuck.hypotheses() if h.name == "stribeck_friction")
    names = [u.name for u in rich.problem.unknowns]
    parts = [names.index(f"stribeck_friction.{n}") for n in ("coulomb_torque", "stribeck_torque")]
    assert rich.addition == parts[1]
    values = rich.likely_values()[:, parts]
    for added, rest in itertools.pairwise(sorted(values.tolist(), key=lambda v: v[1])):
        assert added[1] < rest[1] and added[0] > rest[0], "what it adds takes the place of the rest"
    held = next(h for h in stuck.hypotheses() if h.name == "coulomb_friction")
    sd = held.sd()[held.cause_indices[0]]
    assert values.sum(axis=1) == pytest.approx(held.theta[held.cause_indices[0]], abs=3.0 * sd)


def test_a_stuck_joint_shares_its_name_until_a_torque_frees_it(stuck):
    asked = replace(ASKED, limits=RunLimits(torque=0.6), longest=1.0, test=0.5)
    causes = [h for n in FRICTION for h in stuck.hypotheses() if h.name == n]
    shared = shared_name.shared_name(causes, asked, stuck.cases[0].noise)
    assert shared.names == FRICTION and 1.2 <= shared.torque <= 9.6


def test_a_run_that_leaves_what_is_known_as_it_is_resolves_nothing(stuck):
    named = {h.name: h for h in stuck.hypotheses()}
    odds = {"coulomb_friction": 0.6, "stribeck_friction": 0.399, "nothing": 0.001}
    remain = [replace(named[n], probability=p) for n, p in odds.items()]
    asked = DesignRequest(RunLimits(torque=0.1), refine=0, kinds=("steps",), longest=1.0)
    short = propose(remain, asked, stuck.cases[0].noise)
    assert short.hopeless == (FRICTION,) and short.decided > 0.95 and short.resolved < 0.02
