"""Effects that the rig states belong to the nominal model: they act, are fitted, and are never causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.naming import conclusion as outcome
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel
from rsea_ros.report.diagnosis.terminal import terminal_lines

RATE, DURATION = 280.0, 8.0
RIG = load_rig("paper_high_impedance")
FRICTION = EffectSetting("coulomb_friction", {**effect_named("coulomb_friction").typical, "torque": 3.0})
GAP = EffectSetting("backlash", {**effect_named("backlash").typical, "gap": 4e-3})
FEW = DiagnosisSettings(max_causes=1, without=tuple(set(catalogue()) - {"coulomb_friction", "backlash"}))


def record_bench(*effects):
    command = excitation("multisine", ExcitationSettings(rate=RATE, duration=DURATION, period=4.0))
    bench = RIG.with_effects(*effects)
    return synthesize(bench, Channel(np.arange(len(command)) / RATE, command), seed=3)


def test_a_known_effect_acts_and_is_no_cause():
    """It was reported as a cause without parameters, and the report raised StopIteration."""
    rig = RIG.with_effects(FRICTION)
    rig = replace(rig, known=rig.known | {f"coulomb_friction.{p}" for p in FRICTION.parameters})
    diagnosis = diagnose([record_bench(FRICTION, GAP)], rig, settings=FEW)
    assert [cause.name for cause in diagnosis.causes] == ["backlash"]
    assert diagnosis.causes[0].parameters["gap"].value == pytest.approx(4e-3, rel=0.05)
    assert diagnosis.causes[0].gain_holdout > 0.5
    assert [e.name for e in diagnosis.extended_rig.effects] == ["coulomb_friction", "backlash"]
    assert "backlash" in terminal_lines(diagnosis)[0].plain.lower()


def test_a_stated_effect_is_fitted_with_the_rig_and_not_dropped():
    """It was silently removed from the rig and found again as a cause."""
    guess = replace(FRICTION, parameters={**FRICTION.parameters, "torque": 2.0})
    diagnosis = diagnose([record_bench(FRICTION)], RIG.with_effects(guess), settings=FEW)
    assert (diagnosis.verdict, diagnosis.causes) == ("nothing_wrong", ())
    fitted = {p.name: p.value for p in diagnosis.baseline}
    assert fitted["coulomb_friction.torque"] == pytest.approx(3.0, rel=0.02)


def test_a_record_too_short_for_the_blocks_is_refused_by_the_function_itself():
    with pytest.raises(IdentificationError, match="4 s or more"):
        diagnose([record_bench().between(0.0, 3.0)], RIG, settings=FEW)


def test_an_accepted_effect_that_is_no_cause_is_listed_as_rejected(monkeypatch):
    """With the verdict `unexplained` it was neither a cause nor rejected."""
    monkeypatch.setattr(outcome, "naming_of", lambda *_: {})
    diagnosis = diagnose([record_bench(GAP)], RIG, settings=FEW)
    assert (diagnosis.verdict, diagnosis.causes) == ("unexplained", ())
    dropped = {r.name: r for r in diagnosis.rejected}["backlash"]
    assert dropped.reason == "leaves_too_much" and dropped.gain_holdout > 0.5
