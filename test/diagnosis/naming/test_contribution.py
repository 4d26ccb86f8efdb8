"""The contribution of a cause: a cause that changes nothing has no evidence."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.naming.flexible import rows_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.fit import add_effect, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import MEASURED, Channel

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
