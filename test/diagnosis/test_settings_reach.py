"""Numbers beside the code of the flexible law steer what it says."""

import numpy as np
import pytest
from runs import RATE, RIG

from rsea_ros import simulate
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.naming import flexible as law
from rsea_ros.diagnosis.naming.flexible import flexible, rows_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.unknowns import start_vector


@pytest.fixture(scope="module")
def checked():
    return check(simulate(RIG, np.random.default_rng(3).normal(0.0, 5.0, 1400), RATE, seed=3), RIG)


@pytest.fixture(scope="module")
def with_friction(checked):
    """A problem with Coulomb friction that the record does not have, and its start."""
    problem, effect = nominal_problem([checked], RIG), effect_named("coulomb_friction")
    return add_effect(problem, start_vector(problem.unknowns), effect, effect.typical)


def test_the_knots_of_the_flexible_law(with_friction, monkeypatch):
    rows = rows_of(*with_friction, "coulomb_friction", DEFAULT)
    fine = flexible(*with_friction, "coulomb_friction", rows, DEFAULT).gain
    monkeypatch.setattr(law, "_KNOTS", (0.0, 1.0))
    assert flexible(*with_friction, "coulomb_friction", rows, DEFAULT).gain != fine


def test_the_lags_of_the_flexible_law(checked, monkeypatch):
    problem, delay = nominal_problem([checked], RIG), effect_named("command_delay")
    late = add_effect(problem, start_vector(problem.unknowns), delay, delay.typical)
    rows = rows_of(*late, "command_delay", DEFAULT)
    far = flexible(*late, "command_delay", rows, DEFAULT).gain
    monkeypatch.setattr(law, "_LAGS", (1,))
    assert far > flexible(*late, "command_delay", rows, DEFAULT).gain
