"""The loop finds a hidden cause by designed runs, learns nothing from a broken one, and says why it ends."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent.bench import record_command
from slow_work import ASKED, BENCH, CAUSES, RIG

import rsea_ros.experiment.campaign
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.experiment import advice
from rsea_ros.experiment.advice import HOPELESS, proofs_of
from rsea_ros.experiment.campaign import Budget, Campaign
from rsea_ros.experiment.joint_weighing import causes_from, middles_of_runs, weigh
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.statistics import Z95
from rsea_ros.report.experiment import probability_figure, run_count, write_campaign


@pytest.fixture
def campaign(proposal):
    """Return a function that makes a loop in which every proposed run is the first one."""

    def make(play, **more):
        return Campaign(RIG, CAUSES, ASKED, play, choose=lambda *_: proposal, **more)

    return make


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
def test_without_a_proof_the_longest_run_is_played(log, known, proposal, monkeypatch, proofs, lengths):
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


def test_a_value_that_repeats_counts_once():
    kept = middles_of_runs(np.array([1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 1.0]))
    assert np.flatnonzero(kept).tolist() == [1, 3, 4, 6] or np.flatnonzero(kept).tolist() == [1, 3, 5, 6]


def test_causes_are_effects_of_the_catalogue_each_once():
    assert causes_from("backlash, hard_stop") == ("backlash", "hard_stop")
    for text in ("", "backlash,backlash", "gremlins"):
        with pytest.raises(ParameterError):
            causes_from(text)


def hypothesis(name, *effects):
    rig = SimpleNamespace(effects=[SimpleNamespace(name=e) for e in effects])
    return SimpleNamespace(name=name, problem=SimpleNamespace(rig=rig))


@pytest.mark.parametrize(
    ("forth", "back", "proven"),
    [
        (0.3, 0.1, ("play", "lag")),
        (0.1, 0.3, ("lag", "play")),
        (0.99 * HOPELESS, 0.0, ("play", "lag")),
        (HOPELESS, 0.0, None),
        (0.0, HOPELESS, None),
    ],
)
def test_the_larger_bound_counts(monkeypatch, forth, back, proven):
    def bound(true, rival, limits, seconds, noise, rate, run):
        assert (limits, noise, rate) == ("limits", {"ft": 0.1}, 280.0)
        return SimpleNamespace(most=forth if true.name == "play" else back)

    monkeypatch.setattr(advice, "bound", bound)
    monkeypatch.setattr(advice, "noise_by_channel", lambda hypotheses, measured: measured)
    monkeypatch.setattr(advice, "measurements_apart", lambda b, *both: [(b.most, *(h.name for h in both))])
    pair = hypothesis("play", "ft_bias"), hypothesis("lag")
    asked = SimpleNamespace(limits="limits", rate=280.0)
    proofs = proofs_of(pair, [("play", "lag")], asked, {"ft": 0.1})
    if proven is None:
        assert proofs == ()
    else:
        ((larger, apart, _),) = [tuple(vars(p).values()) for p in proofs]
        assert larger.most == max(forth, back) and apart == ((max(forth, back), *proven),)


@pytest.mark.parametrize(
    ("effects", "is_linear"), [((), True), (("viscoelastic_spring",), True), (("coulomb_friction",), False)]
)
def test_a_proof_says_whether_all_laws_are_linear(monkeypatch, effects, is_linear):
    monkeypatch.setattr(advice, "bound", lambda *a: SimpleNamespace(most=0.0))
    monkeypatch.setattr(advice, "noise_by_channel", lambda hypotheses, measured: {})
    monkeypatch.setattr(advice, "measurements_apart", lambda b, true, rival: [])
    pair = hypothesis("a", "viscoelastic_spring"), hypothesis("b", *effects)
    (proof,) = proofs_of(pair, [("a", "b")], SimpleNamespace(limits=None, rate=1.0), {})
    assert tuple(vars(proof).values())[-1] is is_linear
