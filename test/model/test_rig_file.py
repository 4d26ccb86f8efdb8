"""Rigs and their files: values by name, impossible structures, round trips."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from random_rigs import RIG_NAMES, rigs
from rig_tables import tables

from rsea_ros.effects.catalogue import catalogue
from rsea_ros.errors import RigError
from rsea_ros.model import rig_file
from rsea_ros.model.rig import FIELDS, EffectSetting, PositionLoop, Quantity, Rig, unit_of


def test_every_shipped_rig_is_tested():
    shipped = {path.stem for folder in rig_file.rig_folders()[:1] for path in folder.glob("*.yaml")}
    assert set(RIG_NAMES) <= shipped
    for name in shipped:
        assert rig_file.load_rig(name).name == name


def test_everything_that_a_rig_can_hold_survives(tmp_path):
    rig = replace(
        rig_file.load_rig("bare_drive"),
        controller=PositionLoop(k_p=8.0, k_v=20.0, limit=40.0),
        effects=(EffectSetting("coulomb_friction", {"torque": 2.5}),),
        train="star",
        other_trains=("spur", "planetary"),
    )
    fitted = Quantity(0.9501, 0.02, "fit", (0.94, 0.96))
    rig = replace(rig, quantities={**rig.quantities, "rotor.reflected_inertia": fitted})
    rig_file.save_rig(rig, tmp_path / "model.yaml")
    assert rig_file.load_rig(tmp_path / "model.yaml") == rig


@settings(max_examples=10)
@given(rigs(gravity=True))
def test_any_rig_survives_its_document(rig):
    assert rig_file.rig_from_document(yaml.safe_load(yaml.safe_dump(rig_file.rig_to_document(rig)))) == rig


def test_units_are_read_as_people_write_them(tmp_path):
    text = rig_file.rig_path("paper_high_impedance").read_text().replace("kg m^2", "kg*m²")
    text = text.replace("N m s/rad", "Nms/rad").replace('"1"', "1")
    (tmp_path / "rig.yaml").write_text(text.replace("N m/rad", "Nm/rad").replace("N m", "Nm"))
    assert rig_file.load_rig(tmp_path / "rig.yaml") == rig_file.load_rig("paper_high_impedance")


def test_docs_show_every_key():
    """To mend it: write what `tables()` returns behind the mark in docs/rig.md."""
    page = (Path(__file__).parents[2] / "docs" / "rig.md").read_text(encoding="utf-8")
    assert page.partition("<!-- tables -->\n")[2] == tables()


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_effect_survives_a_file_up_to_its_bounds(name, tmp_path):
    for which in ("null", "typical", "low", "high"):
        values = {p.name: getattr(p, which) for p in catalogue()[name].parameters}
        rig = replace(PAPER, effects=(EffectSetting(name, values),))
        rig_file.save_rig(rig, tmp_path / f"{which}.yaml")
        assert rig_file.load_rig(tmp_path / f"{which}.yaml") == rig


PAPER = rig_file.load_rig("paper_high_impedance")


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


NONSENSE = [
    (name, value) for name, f in FIELDS.items() for value in (math.nan, -1.0, -math.inf) if not value >= f.low
]


def test_units_are_si():
    assert {unit_of(name) for name in FIELDS} == {
        "kg m^2", "N m s/rad", "N m/rad", "N m", "1", "rad", "rad/s", "1/s", "s", "N m/rad/s",
    }


def test_every_field_refuses_nonsense():
    for name, value in NONSENSE:
        with pytest.raises(RigError, match=rf"^paper_high_impedance: {name} = \S+ .*expected"):
            PAPER.with_values({name: value})


@pytest.mark.parametrize(
    ("clamped", "message"),
    [("left", "clamped end 'left', expected one of housing_end, spring_end"),
     ("spring_end", r"housing_end.inertia is missing, expected a value in kg·m²")],
)  # fmt: skip
def test_structures_that_cannot_be_are_refused(clamped, message):
    with pytest.raises(RigError, match=f"^rig paper_high_impedance: {message}"):
        replace(PAPER, clamped=frozenset({clamped}))


def test_an_unknown_field_is_refused():
    with pytest.raises(RigError, match=r"rotor\.mass: no such rig field, expected one of rotor.reflected"):
        Rig("r", {"rotor.mass": Quantity(1.0)})
    with pytest.raises(RigError, match=r"rotor\.mass: no such rig field"):
        PAPER["rotor.mass"]
