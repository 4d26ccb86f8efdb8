"""The channel of verdict and gain, whichever sensors a record has."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel
from rsea_ros.report.diagnosis.files import diagnosis_json

FEW = DiagnosisSettings(max_causes=1, without=tuple(set(catalogue()) - {"coulomb_friction"}))


@pytest.mark.parametrize("name", ["ft", "position", "velocity"])
def test_a_record_with_one_sensor_is_diagnosed_on_it(name):
    """Velocity was missing from the list of main channels."""
    rig = load_rig("paper_high_impedance")
    command = excitation("multisine", ExcitationSettings(rate=280.0, duration=8.0, period=4.0))
    bench = rig.with_effect("coulomb_friction", torque=3.0)
    record = synthesize(bench, Channel(np.arange(len(command)) / 280.0, command), seed=3)
    alone = type(record)({n: record[n] for n in ("command", name)})
    diagnosis = diagnose([alone], rig, settings=FEW)
    assert diagnosis.channel == name == diagnosis_json(diagnosis)["channel"]
    assert [(cause.name, cause.channel) for cause in diagnosis.causes] == [("coulomb_friction", name)]
