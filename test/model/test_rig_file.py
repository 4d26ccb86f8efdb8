"""Rig files survive a round trip; nonsense is one line with file, field, value and expectation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from random_rigs import RIG_NAMES, rigs

from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig import EffectSetting, PositionLoop, Quantity
from rsea_ros.model.rig_document import tables
from rsea_ros.model.rig_file import (
    load_rig,
    rig_folders,
    rig_from_document,
    rig_path,
    rig_to_document,
    save_rig,
)


@pytest.mark.parametrize("name", RIG_NAMES)
def test_shipped_rigs_survive_a_round_trip(name, tmp_path):
    rig = load_rig(name)
    save_rig(rig, tmp_path / "model.yaml")
    assert load_rig(tmp_path / "model.yaml") == rig
    assert [p.name for p in tmp_path.iterdir()] == ["model.yaml"]


def test_every_shipped_rig_is_tested():
    shipped = {path.stem for folder in rig_folders()[:1] for path in folder.glob("*.yaml")}
    assert set(RIG_NAMES) <= shipped
    for name in shipped:
        assert load_rig(name).name == name


def test_everything_that_a_rig_can_hold_survives(tmp_path):
    rig = replace(
        load_rig("bare_drive"),
        controller=PositionLoop(k_p=8.0, k_v=20.0, limit=40.0),
        effects=(EffectSetting("coulomb_friction", {"torque": 2.5}),),
        train="star",
        other_trains=("spur", "planetary"),
    )
    fitted = Quantity(0.9501, 0.02, "fit", (0.94, 0.96))
    rig = replace(rig, quantities={**rig.quantities, "rotor.reflected_inertia": fitted})
    save_rig(rig, tmp_path / "model.yaml")
    assert load_rig(tmp_path / "model.yaml") == rig


@settings(max_examples=30)
@given(rigs(gravity=True))
def test_any_rig_survives_its_document(rig):
    assert rig_from_document(yaml.safe_load(yaml.safe_dump(rig_to_document(rig)))) == rig


def test_units_are_read_as_people_write_them(tmp_path):
    text = rig_path("paper_high_impedance").read_text().replace("kg m^2", "kg*m²")
    text = text.replace("N m s/rad", "Nms/rad").replace('"1"', "1")
    (tmp_path / "rig.yaml").write_text(text.replace("N m/rad", "Nm/rad").replace("N m", "Nm"))
    assert load_rig(tmp_path / "rig.yaml") == load_rig("paper_high_impedance")


def test_docs_show_every_key():
    """To mend it: write what `tables()` returns behind the mark in docs/rig.md."""
    page = (Path(__file__).parents[2] / "docs" / "rig.md").read_text(encoding="utf-8")
    assert page.partition("<!-- tables -->\n")[2] == tables()


@pytest.mark.parametrize("name", sorted(catalogue()))
@pytest.mark.parametrize("which", ["null", "typical", "low", "high"])
def test_every_effect_survives_a_file_up_to_its_bounds(name, which, tmp_path):
    values = {p.name: getattr(p, which) for p in catalogue()[name].parameters}
    rig = replace(load_rig("paper_high_impedance"), effects=(EffectSetting(name, values),))
    save_rig(rig, tmp_path / "model.yaml")
    assert load_rig(tmp_path / "model.yaml") == rig
