"""A designed run separates causes faster than a fixed one, and keeps its limits on every bench."""

from dataclasses import replace

import numpy as np
import pytest
from independent.bench import Bench, record_command
from independent.hidden import hide
from runs import RATE, RIG

from rsea_ros.experiment.advice import HOPELESS, advise, bound
from rsea_ros.experiment.hypothesis import Hypothesis, motion, run_case
from rsea_ros.experiment.joint_weighing import cases_of, problem_of, weights_of
from rsea_ros.experiment.proposal import DesignRequest, at_ends, ends_of, peaks
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import (
    KINDS,
    LEAD,
    RunLimits,
    Shape,
    at_rest_around,
    command_of,
    largest_share,
    of_command,
    of_response,
)
from rsea_ros.experiment.separation import SURE, Refit, chances_decided, refit
from rsea_ros.experiment.stored_models import hypotheses_from, model_of
from rsea_ros.identification.excitation import ExcitationSettings, chirp
from rsea_ros.identification.solver import power, solve
from rsea_ros.identification.unknowns import start_vector

LIMITS = RunLimits(torque=15.0, velocity=1.5, deflection=0.03)
BRIEF = DesignRequest(LIMITS, 280.0, 0.05, 0.8, probe=0.8, refine=0, kinds=("steps",), per_run=0.0)
ASKED = DesignRequest(LIMITS, refine=1, probe=1.0, kinds=("multisine", "chirp"))
NOISE = {"ft": 0.03, "position": 6e-6}


def possible(**causes):
    """Return the hypotheses of causes with their main parameters."""
    return hypotheses_from([model_of(RIG.with_effect(n, **p)) for n, p in causes.items()])


@pytest.fixture(scope="module")
def friction_or_play():
    """Return the causes that slow work leaves open, and the run designed for them."""
    pair = possible(coulomb_friction={"torque": 0.3}, backlash={"gap": 4e-4})
    return pair, propose(pair, ASKED)


def left_of_rival(command, rival, seed):
    """Return the residual over the noise of a rival, fitted to a record of the second bench with play."""
    bench = hide(Bench(), "backlash", {"gap": 4e-4})
    record = record_command(bench, command, np.random.default_rng(seed))
    case = cases_of([record], RIG)[0]
    problem = replace(rival.problem, cases=(replace(case, noise={**case.noise, **NOISE}),))
    return power(solve(problem, rival.theta, iterations=6).residual) - problem.residual(rival.theta).size


def test_the_designed_run_separates_more_a_second_than_the_chirp_on_a_bench_of_other_code(friction_or_play):
    (friction, _), run = friction_or_play
    seconds = 8.0
    size = LIMITS.torque * 0.98
    sweep = chirp(ExcitationSettings(duration=seconds, amplitude=size, noise=0.0, low=0.05, high=100.0))
    ours = left_of_rival(run.command, friction, 1) / run.duration
    fixed = left_of_rival(at_rest_around(sweep, 280.0), friction, 1) / seconds
    assert ours > 1.5 * fixed > 0.0


def test_limits_hold_on_every_bench_drawn_from_what_is_known(friction_or_play):
    pair, run = friction_or_play
    rng = np.random.default_rng(2)
    for true in [rig for h in pair for rig in h.draws(60, rng)]:
        reached = of_response(run.command, motion(true, run.command, run.rate))
        assert largest_share(reached | of_command(run.command, run.rate), LIMITS) <= 1.0
    assert run.peaks.at_level["velocity"] >= run.peaks.expected["velocity"]


def test_a_stop_that_no_record_showed_strikes_no_harder_than_stated():
    """Peaks at 17 distances, most of them beyond its bounds, missed the hardest blow by 4 %."""
    problem = problem_of("hard_stop", RIG, ())
    known = np.diag(weights_of(problem))
    stop = Hypothesis("hard_stop", problem, start_vector(problem.unknowns), known, 0.14)
    command = command_of(Shape("multisine", 4.0, low=0.5, high=8.0), 0.5, 280.0)
    stated = peaks(command, 280.0, ends_of([stop])).at_level["ft"]
    drawn = stop.draws(400, np.random.default_rng(1))
    assert max(of_response(command, motion(r, command, 280.0))["ft"] for r in drawn) <= stated


def test_more_doubt_makes_a_smaller_run():
    sure, unsure = (
        [replace(h, information=h.information * weight) for h in possible(nonlinear_spring={"cubic": 100.0})]
        for weight in (100.0, 1.0)
    )
    tight = DesignRequest(RunLimits(torque=30.0, deflection=0.012), refine=0, kinds=("chirp",), longest=1.0)
    assert propose(unsure, tight).peaks.expected["torque"] < propose(sure, tight).peaks.expected["torque"]


def test_a_peak_at_the_quantile_adds_the_axes_as_squares():
    assert at_ends(np.array([10.0, 9.0, 12.0, 13.0, 11.0, 14.0, 6.0, 5.0, 8.0])) == pytest.approx(15.0)
    assert at_ends(np.array([10.0, 9.0, np.nan])) == np.inf


def test_one_cause_gets_the_run_that_narrows_its_parameters():
    (alone,) = possible(current_loop_lag={"time_constant": 3e-3})
    asked = DesignRequest(LIMITS, refine=0, longest=1.0, probe=1.0, kinds=("chirp",))
    fast = propose([alone], asked)
    slow = propose([alone], replace(asked, limits=replace(LIMITS, slew=60.0)))
    assert fast.sharpened > slow.sharpened + 0.5 > 0.5


def test_a_short_run_is_taken_where_it_decides_and_a_longer_one_where_not():
    pair = possible(command_delay={"delay": 3e-3}, current_loop_lag={"time_constant": 3e-3})
    strong = propose(pair, BRIEF)
    few = replace(BRIEF, limits=replace(LIMITS, torque=0.1))
    weak, priced = (propose(pair, replace(few, per_run=price)) for price in (0.0, 5.0))
    assert strong.duration == pytest.approx(0.05) and strong.decided > 0.9
    assert weak.duration >= 4 * strong.duration
    assert priced.duration > weak.duration, "a price on each run asks for fewer and longer ones"


def test_the_chance_of_a_decision_follows_the_odds_before_and_the_separation():
    pair = possible(coulomb_friction={"torque": 0.3}, backlash={"gap": 4e-4})
    even = [replace(h, probability=0.5) for h in pair]
    none_apart = np.eye(2, dtype=bool)

    def chance(s, pair=even):
        rows = [np.array([[np.inf, s]]), np.array([[s, np.inf]])]
        return chances_decided(pair, rows, none_apart)[0]

    assert chance(2.0 * SURE) == pytest.approx(0.5)
    assert chance(1.0) < 0.02 and chance(40.0) > 0.99
    doubted = [replace(h, probability=p) for h, p in zip(even, (0.01, 0.99), strict=True)]
    assert chance(2.0 * SURE, doubted) < 0.1
    assert chances_decided(even, [np.full((1, 2), np.inf)] * 2, ~none_apart).tolist() == [0.0, 0.0]


def test_no_run_tells_a_torque_constant_from_a_gain_of_the_sensor():
    pair = possible(torque_constant_error={"gain": 1.1}, ft_gain_error={"gain": 1.1})
    advice = advise(pair, replace(ASKED, refine=0, kinds=("chirp",), longest=1.0))
    assert advice.proposal is None
    (proof,) = advice.proofs
    assert proof.covers_all and proof.bound.most < 1e-3 and proof.bound.duration >= 60.0
    assert any("F/T sensor" in a.what for a in proof.apart)
    assert any("stiffness" in a.what and a.separation > 12.0 for a in proof.apart)


def test_the_bound_leaves_room_where_a_run_separates():
    delay, lag = possible(command_delay={"delay": 3e-3}, current_loop_lag={"time_constant": 3e-3})
    room = bound(delay, lag, LIMITS, 10.0, NOISE)
    assert room.most >= HOPELESS
    command = command_of(Shape("multisine", LIMITS.torque), 1.0, 280.0)
    apart = refit(delay, lag, run_case(command, 280.0, NOISE))
    assert isinstance(apart, Refit) and apart.data <= apart.total <= room.most


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slew", [np.inf, 400.0])
def test_a_run_begins_and_ends_at_rest_and_keeps_its_slew(kind, slew):
    command = command_of(Shape(kind, 10.0, bias=2.0), 2.0, RATE, slew)
    asked = of_command(command, RATE)
    assert not command[: round(LEAD * RATE)].any() and command[-1] == 0.0
    assert 1.0 < asked["torque"] <= 12.0 + 1e-9
    assert asked["slew"] <= slew * (1.0 + 1e-6)
