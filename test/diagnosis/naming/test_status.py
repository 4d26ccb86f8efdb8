"""Which causes are named and with which status: probabilities, sizes, and the sentence of the verdict."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from rsea_ros.diagnosis.criteria import verdict_of
from rsea_ros.diagnosis.naming import conclusion as outcome
from rsea_ros.diagnosis.naming.conclusion import is_known, main_channel, sizes
from rsea_ros.diagnosis.naming.evidence import Evidence, Signature
from rsea_ros.diagnosis.naming.flexible import Flexible
from rsea_ros.diagnosis.naming.status import (
    COEFFICIENTS,
    Named,
    features,
    probabilities_and_status,
    probability,
    status_of,
)
from rsea_ros.diagnosis.naming.weighing import Weighed
from rsea_ros.diagnosis.result import CauseParameter
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.unknowns import clocks, unknowns_of_effect
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.diagnosis.words import diagnosis_sentence

RIG = load_rig("paper_high_impedance")
SHARE = st.floats(0.0, 1.0)
SPREAD = st.floats(0.0, 10.0)
SIGNATURES = st.builds(Signature, *[SPREAD] * 4)
FLEXIBLE = st.none() | st.builds(Flexible, SHARE, st.tuples(st.floats(-1.0, 0.5), SHARE))
EVIDENCE = st.builds(
    Evidence,
    st.sampled_from(["coulomb_friction", "command_delay"]),
    SIGNATURES,
    FLEXIBLE,
    st.just("ft"),
    *[SHARE] * 2,
    st.booleans(),
    SHARE,
    st.floats(0.5, 1e3),
    st.booleans(),
)
RIGHT = Evidence(
    "command_delay", Signature(*[0.01] * 4), Flexible(0.0, (-0.01, 0.01)),
    "ft", 0.9, 0.88, True, 0.98, 1.0, False,
)  # fmt: skip


@given(st.lists(EVIDENCE, min_size=1, max_size=4), st.booleans())
def test_a_cause_and_its_rivals_share_one_probability(evidence, at_floor):
    likely, _ = probabilities_and_status(evidence, at_floor)
    assert all(0.0 <= p <= 1.0 for p in likely)
    assert sum(likely) <= 1.0 + 1e-9


@given(SHARE, st.lists(st.floats(0.05, 0.5), max_size=2), st.booleans())
def test_only_what_is_likely_is_confirmed(p, rivals, at_floor):
    rule = DEFAULT.naming
    status = status_of(p, rivals, at_floor, rule)
    if status == "confirmed":
        assert p >= (rule.confirmed_at_floor if at_floor else rule.confirmed)
    if status == "one_of":
        assert rivals


@given(EVIDENCE, st.booleans())
def test_a_cause_that_the_data_speak_against_is_not_named(evidence, at_floor):
    """Away from the floor, or on it already, an effect that takes little must be probable and surely useful.

    On the floor one of 0.04 was named "probably" beside the backlash of a bench of another hand.
    """
    (p,), status = probabilities_and_status([evidence], at_floor, is_needed=False)
    brings = evidence.gain_low >= DEFAULT.acceptance.fall and not evidence.at_edge
    assert (status is None) == (not evidence.is_sure or p < (0.2 if brings else 0.5))


def test_evidence_against_a_law_lowers_its_probability():
    worse = {
        "signature": Signature(*[0.6] * 4),
        "flexible": Flexible(0.4, (0.3, 0.5)),
        "left": 20.0,
        "weight": 0.05,
    }
    for name, value in worse.items():
        assert probability(Evidence(**{**vars(RIGHT), name: value}), True) < probability(RIGHT, True), name
    assert set(features(RIGHT, True)) == set(COEFFICIENTS)


def test_the_floor_of_the_settings_is_the_floor_of_a_cause():
    """It was 1.1 times the noise, whatever `floor.reached` said."""
    near = replace(RIGHT, left=1.2)
    wider = replace(DEFAULT, floor=replace(DEFAULT.floor, reached=1.3))
    assert features(near, True)["noise"] == 0.0
    assert features(near, True, wider)["noise"] == 1.0


def score(**ratios):
    """Return the score of residuals that are so many times the noise, by channel."""
    counts = {n: np.full(4, 100.0) for n in ratios}
    return Score({n: np.full(4, 100.0 * r**2) for n, r in ratios.items()}, counts)


def test_a_cause_whose_misfit_lasts_from_block_to_block_is_not_confirmed():
    """But for what two right simulations differ by: 1e-4 of the contribution also lasts."""
    wandering = replace(RIGHT, signature=replace(RIGHT.signature, carried=4.0, lasting=0.1))
    alike = replace(wandering, signature=replace(wandering.signature, lasting=1e-3))
    every = [probabilities_and_status([e], at_floor=True) for e in (RIGHT, alike, wandering)]
    assert [status for _, status in every] == ["confirmed", "confirmed", "leading"]


@pytest.mark.parametrize(
    ("low", "high", "known"),
    [
        (3.9e-3, 4.1e-3, True),
        (1.0, 9.9, True),
        (1.0, 10.1, False),
        (500.0, 108_893.0, False),  # a base that was not there, beside backlash and friction
        (-0.2, -0.1, True),  # a drift downwards
        (-0.2, 0.1, False),
        (0.0, 1.0, False),
    ],
)
def test_a_size_is_known_that_has_a_sign_and_less_than_a_factor_of_ten(low, high, known):
    assert is_known(CauseParameter(0.5 * (low + high), "N m", (low, high)), DEFAULT.sizes) == known


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "ci95", "begin"),
    [
        ("torque_constant_drift", "time_constant", 1e5, (0.3, 1e5), 0.0),  # it was -0.9 s
        ("command_delay", "delay", 4e-6, (2e-6, 6e-6), 0.0),
        ("torque_constant_drift", "relative_change", 0.01, (-0.02, 0.04), -0.02),
    ],
)
def test_the_models_error_leads_no_interval_below_zero(effect, parameter, value, ci95, begin):
    unit = "s" if begin == 0.0 else "1"
    estimate = ParameterEstimate(f"{effect}.{parameter}", value, unit, ci95, value, 1.0, 1.0)
    ((name, size),) = sizes(effect, [estimate], DEFAULT.sizes).items()
    assert name == parameter and size.statistical_ci95 == ci95
    assert size.ci95[0] == pytest.approx(begin, rel=1e-3, abs=0.0)
    assert size.ci95[1] >= ci95[1]


class Stage:
    """The part of an evaluated model that the naming reads: its fit ended at `values` of some unknowns."""

    def __init__(self, added, unknowns=(), values=(), sd=1e-3):
        self.added = added
        theta = np.array([u.inner(v) for u, v in zip(unknowns, values, strict=True)])
        self.solution = SimpleNamespace(problem=SimpleNamespace(unknowns=unknowns), theta=theta)
        self.confidence = SimpleNamespace(covariance=np.diag(np.full(len(theta), sd**2)))


BASE = unknowns_of_effect(effect_named("base_compliance"), effect_named("base_compliance").typical)
DRIFT = unknowns_of_effect(effect_named("ft_drift"), effect_named("ft_drift").typical)


@pytest.mark.parametrize(
    ("effect", "unknowns", "values", "sd", "status"),
    [
        ("base_compliance", BASE, (3e4, 0.5, 0.02, 0.0), 1e-3, "confirmed"),  # a share may be none
        ("base_compliance", BASE, (3e4, 0.5, 1.0, 0.0), 1e-3, "leading"),  # a spring creeps
        ("base_compliance", BASE, (3e4, 0.5, 1.0, 0.0), 10.0, "confirmed"),  # the data say nothing of it
        ("base_compliance", (*BASE, *clocks(["ft"], RIG)), (3e4, 0.5, 0.02, 0.0, 3e-4), 1e-6, "leading"),
        ("ft_drift", DRIFT, (0.5, 1e5), 1e-9, "confirmed"),  # a straight line
    ],
)  # fmt: skip
def test_a_cause_at_a_bound_leads_at_most(monkeypatch, effect, unknowns, values, sd, status):
    monkeypatch.setattr(outcome, "needed_sizes", lambda *_: [CauseParameter(1.5, "1", (1.4, 1.6))])
    stages = [Stage(""), Stage(effect, unknowns, values, sd)]
    naming = outcome.with_sizes_known({effect: Named(None, 0.99, "confirmed", ())}, stages, DEFAULT)
    assert naming[effect].status == status


@pytest.mark.parametrize(
    ("status", "interval", "after"),
    [
        ("confirmed", (1.0, 2.0), "confirmed"),
        ("confirmed", (1.0, 20.0), "leading"),
        ("one_of", (1.0, 20.0), "one_of"),
        ("leading", (1.0, 20.0), "leading"),
    ],
)
def test_a_cause_of_open_size_leads_at_most(monkeypatch, status, interval, after):
    monkeypatch.setattr(outcome, "needed_sizes", lambda *_: [CauseParameter(1.5, "N m", interval)])
    naming = {"coulomb_friction": Named(None, 0.99, status, ()), "backlash": Named(None, 0.1, None, ())}
    stages = [Stage(""), Stage("backlash"), Stage("coulomb_friction")]
    named = outcome.with_sizes_known(naming, stages, DEFAULT)
    assert {name: n.status for name, n in named.items()} == {"coulomb_friction": after, "backlash": None}
    assert named["coulomb_friction"].probability == 0.99


FLOOR = DEFAULT.floor.reached
RATIOS = st.fixed_dictionaries({n: st.floats(0.3, 300.0) for n in ("ft", "position", "motor_torque")})
NEAR = st.fixed_dictionaries({n: st.floats(0.9, 1.3) for n in ("ft", "position", "motor_torque")})


def score_of(ratios):
    """Return the score of residuals with these ratios to the noise."""
    sums = {n: np.full(4, 100.0 * r**2) for n, r in ratios.items()}
    return Score(sums, {n: np.full(4, 100.0) for n in ratios})


@pytest.mark.parametrize("left", [(3.0, 3.0, 1.0), (3.0, 1.0, 1.0), (3.0, 2.0, 2.0)])
@pytest.mark.parametrize("name", ["backlash", "damping_drift"])
def test_where_only_noise_is_left_already_a_cause_is_named_only_for_a_sure_gain(left, name):
    """A drift of -0.002 % was named in a clean record, a mode beside two delays that left nothing of it.

    left: times the noise, without a cause, with backlash and with both. Of two that act together the first
    may gain nothing alone.
    """
    steps = zip(("", "backlash", "damping_drift"), left, strict=True)
    stages = [SimpleNamespace(added=n, test=score_of({"ft": level})) for n, level in steps]
    evidence = replace(RIGHT, name=name, is_sure=False)
    place = [Weighed(None, evidence)]
    is_needless = (name == "damping_drift" and left[1] == 1.0) or left[2] > 1.0
    assert (outcome.naming_of([place], stages, DEFAULT)[name].status is None) == is_needless


@given(RATIOS | NEAR)
def test_the_sentence_speaks_of_a_channel_that_bears_the_verdict_out(ratios):
    score = score_of(ratios)
    verdict = verdict_of([score])
    channel = main_channel(score, "ft") if verdict == "unexplained" else "ft"
    rms = {channel: score.ratio(channel)}
    diagnosis = SimpleNamespace(
        verdict=verdict, channel=channel, causes=(), faults=(), remarks=(), at_noise_floor=False, spectra=(),
        noise_rms={channel: 1.0}, residual_rms=rms, extended_residual_rms=rms,
    )  # fmt: skip
    sentence = diagnosis_sentence(diagnosis)
    number = float(re.search(r"([\d.]+) times the noise", sentence)[1])
    assert (number <= FLOOR) == (verdict == "nothing_wrong"), sentence
