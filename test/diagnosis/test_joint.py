"""A joint commanded by positions: its causes are found from its log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import JOINT, excitation
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.remark_words import remark_sentences

TRIED = ("coulomb_friction", "command_delay", "backlash", "stribeck_friction", "current_loop_lag")
SETTINGS = DiagnosisSettings(max_causes=2, without=tuple(n for n in catalogue() if n not in TRIED))


def log_joint(rig: Rig, high: float = 3.0) -> Record:
    """Return 8 s of a joint whose inertia, damping and gravity are not those of its rig."""
    targets = excitation("chirp", replace(JOINT, duration=6.0, high=high))
    off = {"rotor.reflected_inertia": 0.026, "rotor.reflected_damping": 0.35, "spring_end.gravity": 0.6}
    stamps = np.arange(len(targets)) / JOINT.rate
    return synthesize(rig.with_values(off), Channel(stamps, targets), seed=6)


def test_friction_and_a_delay_of_the_targets_are_named():
    rig = load_rig("pd_joint")
    true = rig.with_effect("coulomb_friction", torque=0.2).with_effect("command_delay", delay=0.015)
    diagnosis = diagnose([log_joint(true)], rig, settings=SETTINGS)
    assert {c.name for c in diagnosis.causes} == {"coulomb_friction", "command_delay"}
    sizes = {c.name: next(iter(c.parameters.values())).value for c in diagnosis.causes}
    assert sizes["coulomb_friction"] == pytest.approx(0.2, rel=0.03)
    assert sizes["command_delay"] == pytest.approx(0.015, abs=3e-4)
    assert diagnosis.verdict == "explained"
    assert any("cannot determine the play in the gear" in s for s in remark_sentences(diagnosis.remarks))


def test_a_joint_with_other_values_has_no_cause():
    rig = load_rig("pd_joint")
    diagnosis = diagnose([log_joint(rig)], rig, settings=SETTINGS)
    assert (diagnosis.verdict, diagnosis.causes) == ("nothing_wrong", ())
