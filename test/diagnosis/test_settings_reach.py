"""Numbers that were constants of other modules are settings: a changed one reaches what it steers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.naming.flexible import flexible, rows_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.settings import IntervalSettings
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RIG = load_rig("paper_high_impedance")


def steer(group, **values):
    return replace(DEFAULT, **{group: replace(getattr(DEFAULT, group), **values)})


@pytest.fixture(scope="module")
def checked():
    command = Channel(np.arange(1400) / 280.0, np.random.default_rng(3).normal(0.0, 5.0, 1400))
    return check(synthesize(RIG, command, seed=3), RIG)


@pytest.fixture(scope="module")
def with_friction(checked):
    """A problem with Coulomb friction that the record does not have, and its start."""
    problem, effect = nominal_problem([checked], RIG), effect_named("coulomb_friction")
    return add_effect(problem, start_vector(problem.unknowns), effect, effect.typical)


def test_the_correction_of_an_interval_for_few_blocks(checked):
    problem = nominal_problem([checked], RIG)
    solution = solve(problem, iterations=2)
    few, many = (
        np.diag(confidence_of(solution, rule=IntervalSettings(most_corrected=most)).covariance)
        for most in (1.0, 100.0)
    )
    assert np.all(many >= few) and np.any(many > 2.0 * few)


def test_the_knots_of_the_flexible_law(with_friction):
    rows = rows_of(*with_friction, "coulomb_friction", DEFAULT)
    coarse = steer("evidence", knots=(0.0, 1.0))
    gains = [flexible(*with_friction, "coulomb_friction", rows, s).gain for s in (DEFAULT, coarse)]
    assert gains[0] != gains[1]


def test_the_lags_of_the_flexible_law(checked):
    problem, delay = nominal_problem([checked], RIG), effect_named("command_delay")
    late = add_effect(problem, start_vector(problem.unknowns), delay, delay.typical)
    rows = rows_of(*late, "command_delay", DEFAULT)
    short = steer("evidence", lags=(1,))
    gains = [flexible(*late, "command_delay", rows, s).gain for s in (DEFAULT, short)]
    assert gains[0] > gains[1]
