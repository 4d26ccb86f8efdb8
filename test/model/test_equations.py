"""Equations of motion against the energies of the parts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import slow
from hypothesis import given, settings
from random_rigs import rigs

from rsea_ros.errors import RigError
from rsea_ros.model.equations import mechanics, train_ratio
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


@settings(max_examples=40)
@given(rigs(gravity=True))
def test_coordinates_are_the_parts_that_can_move(rig):
    expected = slow.coordinates(rig)
    assert sorted(map(tuple, mechanics(rig).placement.T)) == sorted(map(tuple, expected.T))


def test_both_ends_clamped_is_one_inertia():
    m = mechanics(load_rig("paper_high_impedance"))
    assert m.order == 1
    assert m.mass[0, 0] == pytest.approx(0.953 + 0.0040)
    assert m.damping[0, 0] == pytest.approx(23.088 + 3.0)
    assert m.stiffness[0, 0] == pytest.approx(1530.456)


def test_rotor_is_an_inerter_between_housing_and_chassis():
    """docs/derivation.md: M = [[J_h + J_r (1-N)^2, J_r N (1-N)], [J_r N (1-N), J_sc + J_r N^2]]."""
    rig = load_rig("paper_moving_output")
    n = 502.0
    j_r = 0.953 / n**2
    expected = [[0.101 + j_r * (1 - n) ** 2, j_r * n * (1 - n)], [j_r * n * (1 - n), 0.004 + j_r * n**2]]
    np.testing.assert_allclose(mechanics(rig).mass, expected, rtol=1e-12)


def test_star_train_is_the_planetary_one_held_by_the_other_member():
    """Willis: with annulus and carrier exchanged, 1 / n_star + ... : n_planetary + n_star = 1."""
    rig = load_rig("paper_moving_output")
    assert train_ratio(rig) + train_ratio(replace(rig, train="star")) == 1.0


def test_a_part_that_can_move_needs_an_inertia():
    rig = load_rig("paper_high_impedance").with_values({"gear.stiffness": 1e4, "chassis.inertia": 0.0})
    with pytest.raises(RigError, match="mass matrix is singular"):
        mechanics(rig)


def test_gravity_is_a_stiffness_only_for_small_angles():
    rig = load_rig("pendulum")
    assert mechanics(rig).stiffness[0, 0] == rig["spring_end.gravity"]
    assert mechanics(rig, linear_gravity=False).stiffness[0, 0] == 0.0
    assert math.isinf(rig["gear.stiffness"])
