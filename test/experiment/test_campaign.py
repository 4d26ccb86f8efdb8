"""The loop finds a hidden cause by designed runs, and learns nothing from a run that broke off."""

import json
import re
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent.bench import Bench, record_command
from independent.hidden import hide

import rsea_ros.experiment.campaign
import rsea_ros.experiment.shared_name
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.experiment.campaign import Budget, Campaign
from rsea_ros.experiment.joint_weighing import middles_of_runs, weigh
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_limits import RunLimits
from rsea_ros.experiment.shared_name import SharedName
from rsea_ros.experiment.weighed_causes import causes_from
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.model.rig_file import load_rig
from rsea_ros.normal import Z95
from rsea_ros.report.campaign.files import write_campaign
from rsea_ros.report.campaign.page import probability_figure
from rsea_ros.report.campaign.words import end_sentence, run_count, shared_words

RIG = load_rig("paper_high_impedance")
CAUSES = ("current_loop_lag", "hard_stop")
ASKED = DesignRequest(RunLimits(torque=20.0, velocity=2.0), refine=0, kinds=("multisine",), longest=2.0)
BENCH = hide(Bench(), "current_loop_lag", {"time_constant": 3e-3})


@pytest.fixture(scope="module")
def log():
    """Return a few seconds of slow work, which show no cause."""
    t = np.arange(4 * 280) / 280.0
    return record_command(BENCH, 0.3 * np.sin(2.0 * np.pi * 0.25 * t), np.random.default_rng(1))


@pytest.fixture(scope="module")
def known(log):
    """Return the evidence of the slow work."""
    return weigh([log], RIG, CAUSES)


@pytest.fixture(scope="module")
def proposal(known):
    """Return the first designed run."""
    return propose(known.hypotheses(), ASKED, known.cases[0].noise)


@pytest.fixture
def campaign(proposal):
    """Return a function that makes a loop in which every proposed run is the first one."""

    def make(play, **more):
        return Campaign(RIG, CAUSES, ASKED, play, choose=lambda *_: proposal, **more)

    return make


def test_a_cause_that_the_log_could_not_show_stays_as_likely_as_none(known):
    assert known.probability["hard_stop"] == pytest.approx(known.probability["nothing"], rel=0.1)
    assert min(known.probability.values()) > 0.05


def test_a_cause_of_which_the_log_shows_nothing_is_expected_at_its_usual_size(known):
    lag, stop = ({h.name: h for h in known.hypotheses()}[n] for n in CAUSES)
    usual = effect_named("hard_stop").typical["angle"]
    assert stop.rig_at(stop.if_there()).effects[-1].parameters["angle"] == pytest.approx(usual, rel=0.2)
    angles = [stop.rig_at(v).effects[-1].parameters["angle"] for v in stop.likely_values()]
    assert angles[0] < usual < angles[-1]
    assert np.array_equal(lag.if_there(), lag.theta)


def test_a_cause_that_may_be_none_is_expected_with_some_size(log):
    weighing = weigh([log], RIG, ["nonlinear_spring"])
    spring = next(h for h in weighing.hypotheses() if h.name == "nonlinear_spring")
    main = spring.cause_indices[0]
    assert abs(spring.if_there()[main]) > abs(spring.theta[main])
    sizes = np.abs(spring.likely_values()[:, main]) / spring.sd()[main]
    assert sizes == pytest.approx([0.2, 0.7, 1.4], abs=0.15)


@dataclass(frozen=True)
class Held:
    """What the loop reads of a hypothesis."""

    name: str
    probability: float
    addition: int | None = None

    def beside(self, simpler):
        return self


FRICTION = ("coulomb_friction", "stribeck_friction")
STUCK = {"coulomb_torque": 0.8, "stribeck_torque": 0.7, "stribeck_velocity": 0.05}


@dataclass(frozen=True)
class Known:
    """What the loop reads of a weighing in which a richer cause fits as well as the best."""

    best: str = "current_loop_lag"
    left: float = 1.0
    cases: tuple = (SimpleNamespace(noise={}),)

    @property
    def probability(self):
        return {"current_loop_lag": 0.97, "hard_stop": 0.03}

    def hypotheses(self, least=0.0):
        every = self.probability.items()
        return [Held(n, p) for n, p in every if p >= least]

    def near_by_data(self, least):
        return []

    def richer_by_data(self, least):
        return ["hard_stop"]


@dataclass(frozen=True)
class KnownFriction(Known):
    """A weighing in which the joint did not move enough to show which friction it has."""

    best: str = "coulomb_friction"

    @property
    def probability(self):
        return {"coulomb_friction": 0.97, "stribeck_friction": 0.03}

    def hypotheses(self, least=0.0):
        added = dict(zip(FRICTION, (None, 5), strict=True))
        return [Held(n, p, added[n]) for n, p in self.probability.items()]

    def richer_by_data(self, least):
        return ["stribeck_friction"]


@pytest.mark.parametrize("chance", [0.9, 0.1])
def test_a_name_waits_for_the_run_that_may_show_a_richer_cause(log, proposal, chance):
    tried = replace(proposal, names=("current_loop_lag", "hard_stop"), chances=(0.0, chance))
    asked = []
    work = Campaign(RIG, CAUSES, ASKED, lambda _: None, choose=lambda _, a, *__: asked.append(a) or tried)
    assert work.go([log], Known()).end == "declined"
    assert asked[0].test == work.rules.shown, "designed to separate what is as good as known"


@pytest.mark.parametrize(("chance", "runs"), [(0.0, 0), (0.1, 1)])
def test_a_name_is_shared_where_no_run_would_show_a_richer_cause(
    log, proposal, monkeypatch, tmp_path, chance, runs
):
    weighing = KnownFriction()
    tried = replace(proposal, names=FRICTION, chances=(0.0, chance), duration=2.0, hopeless=())
    monkeypatch.setattr(rsea_ros.experiment.campaign, "weigh", lambda *_: weighing)
    monkeypatch.setattr(rsea_ros.experiment.shared_name, "torque_that_shows", lambda *_: 2.5)
    monkeypatch.setattr(rsea_ros.experiment.campaign, "proofs_of", lambda *_: ())
    outcome = Campaign(RIG, FRICTION, ASKED, lambda _: log, choose=lambda *_: tried).go([log], weighing)
    assert (outcome.end, len(outcome.rounds) - 1) == ("undecidable", runs)
    assert outcome.shared == SharedName(FRICTION, 2.5)
    assert end_sentence(outcome).startswith(
        "Coulomb friction (0.97) or Stribeck friction (0.03): no run within the limits shows which after "
    )
    assert end_sentence(outcome).endswith("; it takes at least about 2.5 N·m")
    assert shared_words(replace(outcome, shared=SharedName(FRICTION, None))).endswith(
        "within the limits shows which"
    )


@pytest.fixture(scope="module")
def stuck():
    """Return the weighing of friction by slow work in which the joint stays stuck."""
    bench = hide(Bench(), "stribeck_friction", STUCK)
    t = np.arange(10 * 280) / 280.0
    return weigh([record_command(bench, 0.5 * np.sin(1.6 * t), np.random.default_rng(4))], RIG, FRICTION)


def test_a_cause_that_contains_another_fits_no_worse(stuck):
    simple, rich = (stuck.fits[n] for n in FRICTION)
    assert rich.solution.cost < simple.solution.cost + 2.0, "a local minimum"
    assert stuck.probability["coulomb_friction"] < 0.95, "confirmed by what slow work cannot show"


def test_what_a_richer_cause_adds_is_rated_within_what_is_known(stuck):
    rich = next(h for h in stuck.hypotheses() if h.name == "stribeck_friction")
    names = [u.name for u in rich.problem.unknowns]
    parts = [names.index(f"stribeck_friction.{n}") for n in ("coulomb_torque", "stribeck_torque")]
    assert rich.addition == parts[1]
    values = rich.likely_values()[:, parts]
    assert (np.diff(values[:, 1]) > 0.0).all() and (np.diff(values[:, 0]) < 0.0).all()
    held = next(h for h in stuck.hypotheses() if h.name == "coulomb_friction")
    sd = held.sd()[held.cause_indices[0]]
    assert values.sum(axis=1) == pytest.approx(held.theta[held.cause_indices[0]], abs=3.0 * sd)


@pytest.mark.parametrize(("torque", "end"), [(0.6, "undecidable"), (6.0, "declined")])
def test_a_stuck_joint_is_told_only_by_what_frees_it(stuck, log, torque, end):
    sure = replace(stuck, probability={"coulomb_friction": 0.96, "stribeck_friction": 0.04})
    asked = replace(ASKED, limits=RunLimits(torque=torque))
    outcome = Campaign(RIG, FRICTION, asked, lambda _: None).go([log], sure)
    assert outcome.end == end
    if end == "undecidable":
        assert outcome.shared is not None and outcome.shared.names == FRICTION
        assert outcome.shared.torque is not None and 1.2 <= outcome.shared.torque <= 9.6


def test_a_richer_cause_is_tested_once(log, proposal, monkeypatch):
    tried = replace(proposal, names=("current_loop_lag", "hard_stop"), chances=(0.0, 0.9))
    monkeypatch.setattr(rsea_ros.experiment.campaign, "weigh", lambda *_: Known())
    outcome = Campaign(RIG, CAUSES, ASKED, lambda _: log, choose=lambda *_: tried).go([log], Known())
    assert outcome.end == "confirmed" and len(outcome.rounds) == 2


def test_the_next_run_is_as_long_as_all_that_did_not_decide(log, known, proposal, monkeypatch):
    monkeypatch.setattr(rsea_ros.experiment.campaign, "weigh", lambda *_: known)
    lengths = []

    def choose(possible, asked, *_):
        lengths.append((asked.shortest, asked.longest))
        return replace(proposal, duration=asked.shortest, decided=1.0, resolved=1.0)

    outcome = Campaign(RIG, CAUSES, ASKED, lambda _: log, Budget(seconds=5.2), choose=choose).go([log], known)
    expected = [(0.5, 2.0), (0.5, 2.0), (1.0, 2.0), (2.0, 2.0), (1.2, 1.2)]
    assert np.array(lengths) == pytest.approx(np.array(expected))
    assert outcome.end == "spent" and outcome.seconds == pytest.approx(5.2)


@pytest.mark.parametrize(("proofs", "lengths"), [((), [2.0]), ((False,), [2.0]), ((True,), [])])
def test_without_a_proof_the_longest_run_is_played(
    log, known, proposal, monkeypatch, proofs, lengths
):
    monkeypatch.setattr(rsea_ros.experiment.campaign, "weigh", lambda *_: known)
    pair = known.best, "hard_stop"
    proved = tuple(SimpleNamespace(covers_all=p, pair=pair) for p in proofs)
    monkeypatch.setattr(rsea_ros.experiment.campaign, "proofs_of", lambda *_: proved)
    small = replace(proposal.peaks, at_level=dict.fromkeys(proposal.peaks.at_level, 0.0))
    designed = iter([0.5, 2.0, 2.0])

    def choose(*_):
        return replace(proposal, duration=next(designed), decided=0.0, resolved=0.0, peaks=small)

    outcome = Campaign(RIG, CAUSES, ASKED, lambda _: log, choose=choose).go([log], known)
    assert (outcome.end, outcome.proofs) == ("undecidable", proved)
    assert [r.proposal.duration for r in outcome.rounds if r.proposal] == lengths


def test_the_loop_confirms_the_hidden_cause_by_a_run(log, known, campaign, tmp_path):
    rng, played = np.random.default_rng(2), []

    def play(proposal):
        played.append(proposal)
        return record_command(BENCH, proposal.command, rng)

    work = campaign(play)
    outcome = work.go([log], known)
    assert (outcome.end, outcome.cause) == ("confirmed", "current_loop_lag")
    assert outcome.seconds == sum(p.duration for p in played) <= 2.0
    assert len(outcome.records) == 1 + len(played)
    report = write_campaign(outcome, work, tmp_path / "out").read_text(encoding="utf-8")
    assert "Current loop lag" in report and "after run 1" in report
    value, half = map(float, re.search(r"time constant ([\d.]+) ± ([\d.]+) ms:", report).groups())
    assert abs(value - 3.0) < half and half > 1e3 * Z95 * CLOCK_DOUBT, "not 95 %, as a diagnosis states it"
    assert len(played) == 1 and run_count(outcome) == ("1", "run")
    notes = probability_figure(outcome).layout["annotations"]
    assert notes and all((n["xref"], n["xanchor"]) == ("paper", "left") for n in notes), "cut on a phone"
    said = json.loads((tmp_path / "out" / "experiment.json").read_text(encoding="utf-8"))
    assert said["end"] == "confirmed" and len(said["rounds"]) == len(played) + 1
    assert load_rig(tmp_path / "out" / "model.yaml").effects[-1].name == "current_loop_lag"


def test_nothing_is_learnt_from_a_run_that_broke(log, known, campaign):
    def play(proposal):
        raise DeviceError("driver: overload")

    outcome = campaign(play).go([log], known)
    assert outcome.end == "broken" and "overload" in outcome.why
    assert outcome.records == (log,) and outcome.seconds == 0.0
    assert outcome.weighing.probability == known.probability


def test_a_person_may_say_no(log, known, campaign):
    outcome = campaign(lambda proposal: None).go([log], known)
    assert outcome.end == "declined" and outcome.seconds == 0.0


def test_a_budget_that_is_too_small_for_a_run_ends_the_loop(log, known, campaign):
    outcome = campaign(lambda proposal: pytest.fail("played"), budget=Budget(seconds=0.1)).go([log], known)
    assert outcome.end == "spent"


def test_a_value_that_repeats_counts_once():
    kept = middles_of_runs(np.array([1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 1.0]))
    assert np.flatnonzero(kept).tolist() == [1, 3, 4, 6] or np.flatnonzero(kept).tolist() == [1, 3, 5, 6]


def test_causes_are_effects_of_the_catalogue_each_once():
    assert causes_from("backlash, hard_stop") == ("backlash", "hard_stop")
    for text in ("", "backlash,backlash", "gremlins"):
        with pytest.raises(ParameterError):
            causes_from(text)


def test_a_run_that_leaves_what_is_known_as_it_is_resolves_nothing(stuck):
    named = {h.name: h for h in stuck.hypotheses()}
    odds = {"coulomb_friction": 0.6, "stribeck_friction": 0.399, "nothing": 0.001}
    remain = [replace(named[n], probability=p) for n, p in odds.items()]
    asked = DesignRequest(RunLimits(torque=0.1), refine=0, kinds=("steps",), longest=1.0)
    short = propose(remain, asked, stuck.cases[0].noise)
    assert short.hopeless == (FRICTION,) and short.decided > 0.95 and short.resolved < 0.02
