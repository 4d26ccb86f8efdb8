"""Effects that the rig states act, are fitted, and are never causes; the channel and rate of a verdict."""

from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG, excited, only, trying

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.evaluation import Examined
from rsea_ros.diagnosis.naming import conclusion as outcome
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.model.rig import EffectSetting
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.diagnosis.page import diagnosis_json
from rsea_ros.report.diagnosis.words import terminal_lines

FRICTION = EffectSetting("coulomb_friction", {**effect_named("coulomb_friction").typical, "torque": 3.0})
GAP = EffectSetting("backlash", {**effect_named("backlash").typical, "gap": 4e-3})
FEW = trying("coulomb_friction", "backlash", max_causes=1)
FRICTION_ALONE = trying("coulomb_friction", max_causes=1)


def record_bench(*effects):
    return excited(RIG.with_effects(*effects), "multisine", sensors=3, duration=5.0, period=2.5)


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
    diagnosis = diagnose([record_bench(FRICTION)], RIG.with_effects(guess), settings=FRICTION_ALONE)
    assert (diagnosis.verdict, diagnosis.causes) == ("nothing_wrong", ())
    fitted = {p.name: p.value for p in diagnosis.baseline}
    assert fitted["coulomb_friction.torque"] == pytest.approx(3.0, rel=0.02)


def test_a_record_too_short_for_the_blocks_is_refused_by_the_function_itself():
    with pytest.raises(IdentificationError, match="4 s or more"):
        diagnose([record_bench().between(0.0, 3.0)], RIG, settings=FEW)


def test_an_accepted_effect_that_is_no_cause_is_listed_as_rejected(monkeypatch):
    """With the verdict `unexplained` it was neither a cause nor rejected."""
    monkeypatch.setattr(outcome, "naming_of", lambda *_: {})
    diagnosis = diagnose([record_bench(GAP)], RIG, settings=trying("backlash", max_causes=1))
    assert (diagnosis.verdict, diagnosis.causes) == ("unexplained", ())
    dropped = {r.name: r for r in diagnosis.rejected}["backlash"]
    assert dropped.reason == "leaves_too_much" and dropped.gain_holdout > 0.5


def test_a_record_with_one_sensor_is_diagnosed_on_it():
    """Velocity was missing from the list of main channels."""
    diagnosis = diagnose([only(record_bench(FRICTION), "velocity")], RIG, settings=FRICTION_ALONE)
    assert diagnosis.channel == "velocity" == diagnosis_json(diagnosis)["channel"]
    assert [(cause.name, cause.channel) for cause in diagnosis.causes] == [("coulomb_friction", "velocity")]


def test_the_rate_is_that_of_the_samples_without_their_copies():
    """Every message was logged twice."""
    once = record_bench().channels
    twice = Record({n: Channel(np.repeat(c.t, 2), np.repeat(c.y, 2)) for n, c in once.items()})
    assert Examined([twice], [check(twice, RIG)], None, RIG).rate == pytest.approx(RATE)
