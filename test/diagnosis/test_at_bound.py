"""A time within the error of the clocks is no effect, however surely it helps."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.candidate import is_at_bound
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.model.rig_file import load_rig


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("current_loop_lag", 2.5e-5, True),
        ("command_delay", 1.5e-4, True),
        ("current_loop_lag", 1e-3, False),
        ("command_delay", 1.2e-3, False),
        ("coulomb_friction", 1e-4, False),
    ],
)
def test_a_time_that_a_clocks_error_may_make_is_at_its_bound(name, value, expected):
    effect = effect_named(name)
    unknowns = unknowns_of_effect(effect, {**effect.typical, effect.main.name: value})
    problem = Problem((), load_rig("paper_high_impedance"), unknowns, ("ft", "position"))
    solution = Solution(problem, start_vector(unknowns), np.zeros(0), np.zeros((0, len(unknowns))), 0.0)
    assert is_at_bound(solution, name, 1e-6) is expected
