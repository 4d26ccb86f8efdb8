"""A row has the parameters fitted together with the causes: otherwise backlash softens the spring."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from rsea_extras.fleet import analysis
from rsea_extras.fleet.store import empty
from rsea_ros.diagnosis import diagnose as engine
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel


def test_a_row_has_the_parameters_of_the_fit_with_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = load_rig("paper_high_impedance")
    u = excitation("chirp", ExcitationSettings(duration=6.0, seed=2))
    gap = EffectSetting("backlash", {"gap": 3e-3})
    record = synthesize(rig.with_effects(gap), Channel(np.arange(len(u)) / 280.0, u), seed=2)
    others = tuple(name for name in catalogue() if name != "backlash")
    short = partial(engine.diagnose, settings=DiagnosisSettings(without=others))
    monkeypatch.setattr(analysis.steps, "diagnose", short)
    row = empty("knee", parameters=[{"name": "spring.stiffness", "value": 1340.0}])
    assert "diagnosis.json" in analysis._diagnose(row, record, rig, page=False)
    assert [c["name"] for c in row["causes"]] == ["backlash"]
    values = {p["name"]: p for p in row["parameters"]}
    assert values["spring.stiffness"]["value"] == pytest.approx(rig["spring.stiffness"], rel=0.005)
    assert values["spring.stiffness"]["identifiable"]
