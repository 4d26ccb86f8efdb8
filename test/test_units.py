"""Units: every common spelling of a unit is accepted for it and for no other."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.documents.units import same_unit
from rsea_ros.model.rig import FIELDS
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.records.record import UNITS

WAYS = {
    "N m": ["Nm", "N*m", "N·m", "N.m", "N-m", "N⋅m", " N  m "],
    "kg m^2": ["kgm2", "kg*m^2", "kg m²", "kg·m²", "kg m**2", "kgm^2", "kg m2"],
    "N m s/rad": ["Nms/rad", "N*m*s/rad", "Nm s/rad", "N·m·s/rad", "Nm/(rad/s)", "N m s / rad"],
    "N m/rad": ["Nm/rad", "N*m/rad", "N·m / rad"],
    "rad/s": ["rad / s"],
    "1": [1, "-", "1"],
    "deg": ["°"],
    "us": ["μs", "µs"],
    "rpm": ["rev/min"],
}


@pytest.mark.parametrize(("unit", "text"), [(u, text) for u, texts in WAYS.items() for text in texts])
def test_a_unit_may_be_written_in_many_ways(unit, text):
    assert same_unit(text, unit)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("m s", "ms"), ("mN m", "N m"), ("m N", "N m"), ("N/m", "N m"), ("Nm", "N m/rad"), ("kg m", "kg m^2"),
     ("rads", "rad/s"), ("", "1"), (None, "1"),
     ("r p m", "rpm"), ("NM", "N m"), (True, "1"), ("N m^2", "N m")],
)  # fmt: skip
def test_a_different_unit_is_not_accepted(text, unit):
    assert not same_unit(text, unit)


def test_no_two_units_of_the_rig_share_a_spelling():
    units = {field.unit for field in FIELDS.values()} | set(UNITS.values())
    assert not [pair for pair in itertools.permutations(units, 2) if same_unit(*pair)]


def test_a_linear_machine_has_units_of_its_own(tmp_path):
    """The published drive of EMPS was said to have 95 kg m^2."""
    rig = load_rig("emps")
    assert rig.linear and load_rig(save(rig, tmp_path / "rig.yaml")).linear
    t = np.arange(1200) / 300.0
    force = 60.0 * np.sign(np.sin(2.0 * np.pi * 1.3 * t)) * np.exp(-0.1 * t)
    record = rsea.simulate(replace(rig, controller=None), force, 300.0, seed=1)
    units = {p.name: p.unit for p in rsea.identify(record, replace(rig, controller=None)).parameters.values()}
    assert units["rotor.reflected_inertia"] == "kg" and units["coulomb_friction.torque"] == "N"
    assert units["rotor.reflected_damping"] == "N s/m"


def save(rig, path):
    save_rig(rig, path)
    return path
