"""Equations of motion against the energies of the parts."""

import math

import numpy as np
import pytest
import slow
from hypothesis import given, settings
from random_rigs import rigs

from rsea_ros.errors import RigError
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig


@settings(max_examples=40)
@given(rigs(gravity=True))
def test_matrices_are_those_of_the_energies(rig):
    m = mechanics(rig)
    p = m.placement
    for ours, form in (
        (m.mass, lambda w: slow.kinetic(rig, w)),
        (m.damping, lambda w: slow.dissipation(rig, w)),
        (m.stiffness, lambda q: slow.potential(rig, q, small_angles=True)),
    ):
        expected = slow.quadratic(form, p)
        np.testing.assert_allclose(ours, expected, atol=1e-9 * (np.abs(expected).max() + 1e-9))


def test_a_part_that_can_move_needs_an_inertia():
    rig = load_rig("paper_high_impedance").with_values({"gear.stiffness": 1e4, "chassis.inertia": 0.0})
    with pytest.raises(RigError, match="mass matrix is singular"):
        mechanics(rig)


def test_gravity_is_a_stiffness_only_for_small_angles():
    rig = load_rig("pendulum")
    assert mechanics(rig).stiffness[0, 0] == rig["spring_end.gravity"]
    assert mechanics(rig, linear_gravity=False).stiffness[0, 0] == 0.0
    assert math.isinf(rig["gear.stiffness"])
