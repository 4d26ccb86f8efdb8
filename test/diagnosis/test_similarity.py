"""A diagnosis does not depend on how strong a machine is: bounds and starts scale with its size.

Scales are powers of 4, so that a machine 4^n times as strong gives the same to rounding.
"""

import numpy as np
import pytest
from runs import RIG
from similar_machine import factor, record_with, similar

from rsea_ros.diagnosis.diagnose import searched_effects
from rsea_ros.diagnosis.initial_guess import RecordView, initial_guesses
from rsea_ros.diagnosis.step_fits import screen
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.fit import unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import apply
from rsea_ros.records.record import MEASURED

SHOWN = ("coulomb_friction", "spring_hysteresis")


def screen_effect(name, times):
    """Return the screening of an effect on a machine with the torque scaled by a factor."""
    record, rig = record_with(RIG, effect_named(name), times, duration=5.0), similar(RIG, times)
    case = case_from(record, rig)
    current = solve(Problem((case,), rig, unknowns_of(rig, (case,)), MEASURED), iterations=3)
    (effect,) = (e for e in searched_effects(current.problem, ()) if e.name == name)
    fitted, _ = apply(current.problem.rig, current.problem.unknowns, current.theta)
    view = RecordView(case, fitted, current.problem.outputs(current.theta)[0])
    return screen(current, effect, initial_guesses(effect, view))


@pytest.mark.parametrize("name", SHOWN)
def test_screening_is_the_same_on_a_similar_machine(name):
    times = 4.0**-5
    one, other = screen_effect(name, 1.0), screen_effect(name, times)
    assert other.cost == pytest.approx(one.cost, rel=1e-5)
    pairs = zip(one.problem.unknowns, one.theta, other.theta, strict=True)
    for unknown, a, b in pairs:
        if unknown.name.startswith(name):
            expected = unknown.outer(float(a)) * factor(unknown.unit, times)
            same = next(u for u in other.problem.unknowns if u.name == unknown.name)
            np.testing.assert_allclose(same.outer(float(b)), expected, rtol=1e-4, err_msg=unknown.name)
