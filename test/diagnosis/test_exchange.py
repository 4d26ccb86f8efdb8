"""A cause gives its place to another one along the derivatives, with all that must change beside them."""

import numpy as np
import pytest
from runs import RATE, RIG

from rsea_ros import simulate
from rsea_ros.diagnosis.stepwise import in_exchange
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.fit import add_effect, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.records.record import MEASURED


@pytest.mark.parametrize(
    ("hidden", "found"),
    [("torque_constant_error", "ft_gain_error"), ("ft_gain_error", "torque_constant_error")],
)
def test_between_two_scales_of_the_torque_the_rest_changes_with_them(hidden, found):
    """From elsewhere the fit of the right one stopped in a valley, and the wrong one was `confirmed`."""
    rig, t = RIG, np.arange(2240) / RATE
    command = 20.0 * np.sin(2.0 * np.pi * (0.3 + 1.5 * t) * t)
    record = simulate(rig.with_effect(hidden, gain=1.1), command, RATE, seed=1)
    case = case_from(record, rig)
    unknowns = tuple(u for u in unknowns_of(rig, (case,)) if not u.is_clock)
    nominal = Problem((case,), rig, unknowns, MEASURED)
    problem, theta = add_effect(nominal, start_vector(unknowns), effect_named(found), {"gain": 1.1})
    solution = solve(problem, theta)
    assert solution.rms < 1.1 and abs(solution.values["rotor.reflected_inertia"] / 0.953 - 1.0) > 0.06
    there = in_exchange(solution, found, effect_named(hidden))
    assert there["gain"] == pytest.approx(1.1, rel=0.02)
    for name in ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness"):
        assert there[name] == pytest.approx(rig[name], rel=0.03), name
