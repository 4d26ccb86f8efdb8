"""Rig: values by name, values that a fit may move, and impossible structures."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from random_rigs import RIG_NAMES

from rsea_ros.errors import RigError
from rsea_ros.model.rig import FIELDS, Quantity, Rig, check_value, unit_of
from rsea_ros.model.rig_file import load_rig

PAPER = load_rig("paper_high_impedance")


def test_a_value_left_out_has_its_default():
    assert PAPER["gear.stiffness"] == math.inf
    assert PAPER["housing_end.gravity"] == 0.0


def test_with_values_keeps_spread_and_source():
    changed = PAPER.with_values({"spring.stiffness": 1600.0})
    assert changed["spring.stiffness"] == 1600.0 and PAPER["spring.stiffness"] == 1530.456
    assert changed.spread("spring.stiffness") == PAPER.spread("spring.stiffness") > 0
    assert changed.quantities["spring.stiffness"].source == "Table 2 (measured)"


def test_values_with_a_spread_that_are_not_known_are_free():
    assert set(PAPER.free()) == {
        "rotor.reflected_inertia",
        "rotor.reflected_damping",
        "spring.stiffness",
        "spring.damping",
    }


def test_values_are_all_that_the_file_states():
    assert set(PAPER.values()) == {*PAPER.free(), "gear.ratio", "chassis.inertia"}


@pytest.mark.parametrize("name", RIG_NAMES)
def test_known_values_of_shipped_rigs_stay(name):
    rig = load_rig(name)
    assert rig.known and not set(rig.free()) & rig.known


NONSENSE = [
    (name, value) for name, f in FIELDS.items() for value in (math.nan, -1.0, -math.inf) if not value >= f.low
]


def test_units_are_si():
    assert {unit_of(name) for name in FIELDS} == {
        "kg m^2", "N m s/rad", "N m/rad", "N m", "1", "rad", "rad/s", "1/s", "s", "N m/rad/s",
    }


@pytest.mark.parametrize(("name", "value"), NONSENSE)
def test_every_field_refuses_nonsense(name, value):
    with pytest.raises(RigError, match=rf"^paper_high_impedance: {name} = \S+ .*expected"):
        PAPER.with_values({name: value})


@pytest.mark.parametrize("name", [n for n, f in FIELDS.items() if f.default != math.inf])
def test_infinite_is_for_rigid_parts_only(name):
    with pytest.raises(RigError, match=f"{name} = inf"):
        check_value(name, math.inf)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"rigid_spring": True},
            "spring rigid and spring_end clamped, expected one of them: nothing could move",
        ),
        ({"train": "worm"}, "gear.train = 'worm', expected one of planetary, star, harmonic_"),
        ({"proximal": "left"}, "proximal = 'left', expected one of housing_end, spring_end"),
        ({"clamped": frozenset({"left"})}, "clamped end 'left', expected one of housing_end, spring_end"),
        (
            {"clamped": frozenset({"housing_end"})},
            r"spring_end.inertia is missing, expected a value in kg·m²",
        ),
        (
            {"clamped": frozenset({"spring_end"})},
            r"housing_end.inertia is missing, expected a value in kg·m²",
        ),
    ],
)
def test_structures_that_cannot_be_are_refused(changes, message):
    with pytest.raises(RigError, match=f"^rig paper_high_impedance: {message}"):
        replace(PAPER, **changes)


@pytest.mark.parametrize("name", ["rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness"])
def test_a_rig_without_a_required_value_is_refused(name):
    quantities = {n: q for n, q in PAPER.quantities.items() if n != name}
    with pytest.raises(RigError, match=f"{name} is missing"):
        replace(PAPER, quantities=quantities, known=frozenset())


def test_an_unknown_field_is_refused():
    with pytest.raises(
        RigError, match=r"rotor\.mass: no such rig field, expected one of rotor.reflected_inertia"
    ):
        Rig("r", {"rotor.mass": Quantity(1.0)})
    with pytest.raises(RigError, match=r"rotor\.mass: no such rig field"):
        PAPER["rotor.mass"]
