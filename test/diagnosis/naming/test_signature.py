"""The evidence of a cause: its signature, its contribution, and the weight of its rivals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.diagnosis.naming.evidence import signature
from rsea_ros.diagnosis.naming.flexible import ContributionRows, project_out, rows_of
from rsea_ros.diagnosis.naming.weighing import stacking_weights
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.fit import add_effect, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import MEASURED, Channel

BLOCKS, LENGTH = 48, 100
RNG = np.random.default_rng(5)
TIME = np.arange(BLOCKS * LENGTH) / LENGTH
CONTRIBUTION = 5.0 * np.sin(2.0 * np.pi * 0.21 * TIME**1.4)
"""A sweep of amplitude 5 times the noise."""


def rows(residual):
    """Return rows of one channel whose nominal model has one derivative, a ramp."""
    return ContributionRows(
        contribution=CONTRIBUTION, residual=residual + RNG.normal(size=len(TIME)),
        others=TIME[:, None] - TIME.mean(), prior=np.array([1e-3]),
        block=np.repeat(np.arange(BLOCKS), LENGTH), tests=np.repeat(np.arange(BLOCKS) % 4 == 3, LENGTH),
        runs=(slice(0, len(TIME)),),
    )


@pytest.mark.parametrize("size", [0.0, 0.3])
def test_a_law_of_the_right_shape_spreads_no_more_than_by_noise_whatever_its_size(size):
    """lambda of a block of 100 samples has an sd of sqrt(2) / 5 / sqrt(100) by the noise alone."""
    s = signature(rows(size * CONTRIBUTION))
    assert s.overall < 1.5 * np.sqrt(2.0 / LENGTH) / 5.0
    assert max(s.amplitude, s.time, abs(s.frequency - size)) < 0.04  # frequency counts the size too


@pytest.mark.parametrize(
    ("law", "respect"),
    [
        (CONTRIBUTION * (TIME - TIME.mean()) / TIME.mean(), "time"),
        (CONTRIBUTION * (np.abs(CONTRIBUTION) - 3.5) / 2.5, "amplitude"),
        (np.gradient(CONTRIBUTION, TIME) / 10.0, "frequency"),
    ],
)
def test_a_law_of_another_shape_shows_where_it_is_wrong(law, respect):
    s, right = signature(rows(0.5 * law)), signature(rows(0.0 * law))
    assert getattr(s, respect) > 3.0 * getattr(right, respect) + 0.05


def test_what_the_other_unknowns_can_imitate_does_not_count():
    imitated = replace(rows(np.zeros(len(TIME))), contribution=7.0 * (TIME - TIME.mean()))
    assert np.abs(project_out(imitated, imitated.contribution)).max() < 1e-6


def test_a_residual_that_wanders_is_carried_from_block_to_block_and_noise_is_not():
    """A wandering zero beside a drift left as small a residual as noise, and the drift was confirmed."""
    walk = np.cumsum(np.random.default_rng(6).normal(size=len(TIME))) * 0.02
    drift = replace(rows(np.zeros(len(TIME))), contribution=TIME - 30.0)
    assert abs(signature(drift).carried) < 2.6
    assert signature(replace(drift, residual=drift.residual + walk)).carried > 2.6


RIG = load_rig("paper_high_impedance")


@pytest.fixture(scope="module")
def problem() -> Problem:
    command = Channel(np.arange(1400) / 280.0, np.random.default_rng(3).normal(0.0, 5.0, 1400))
    case = case_from(synthesize(RIG, command, seed=3), RIG)
    return Problem((case,), RIG, unknowns_of(RIG, (case,)), MEASURED)


@pytest.mark.parametrize(("angle", "acts"), [(0.002, True), (3.0, False)])
def test_a_stop_beyond_the_travel_has_no_evidence(problem, angle, acts):
    """It was named with a probability of 0.92: where nothing is contributed, no shape is wrong."""
    stop = effect_named("hard_stop")
    start = {**stop.typical, "angle": angle}
    larger, theta = add_effect(problem, start_vector(problem.unknowns), stop, start)
    rows = rows_of(larger, theta, "hard_stop", DEFAULT)
    assert (rows is not None) == acts


LOSS = np.random.default_rng(3).chisquare(50, size=30)


def test_models_that_do_the_same_share_the_weight():
    assert stacking_weights([LOSS, LOSS], [0.0, 0.0]) == pytest.approx([0.5, 0.5])


def test_a_model_that_loses_more_in_every_block_gets_no_weight():
    assert stacking_weights([LOSS, LOSS + 3.0], [0.0, 0.0])[1] < 1e-6


def test_luck_in_a_few_blocks_does_not_decide():
    lucky = LOSS + np.where(np.arange(30) == 0, -30.0, 0.7)
    plain = 1.0 / (1.0 + np.exp(-0.5 * (LOSS.sum() - lucky.sum())))
    assert plain > 0.98
    assert stacking_weights([LOSS, lucky], [0.0, 0.0])[0] > 0.1


def test_the_cost_of_the_prior_counts():
    first, second = stacking_weights([LOSS, LOSS], [0.0, 4.0])
    assert first / second == pytest.approx(np.exp(2.0))
