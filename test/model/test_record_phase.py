"""A phase that belongs to a record is estimated from it; the rest of the model stays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rsea_ros.model.prediction_errors import in_phase, predict
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel


def hum(phase: float) -> Rig:
    parameters = {"amplitude": 0.2, "frequency": 50.02, "phase": phase}
    return load_rig("paper_high_impedance").with_effects(EffectSetting("mains_interference", parameters))


@pytest.mark.parametrize("phase", [-2.9, 0.4, 2.0])
def test_the_mains_are_predicted_whenever_the_record_began(phase):
    command = 10.0 * np.random.default_rng(3).standard_normal(2800)
    record = synthesize(hum(phase), Channel(np.arange(2800) / 280.0, command), seed=5)
    phased = in_phase(hum(1.0), record).effects[0].parameters
    assert math.remainder(phased["phase"] - phase, 2.0 * math.pi) == pytest.approx(0.0, abs=0.03)
    assert phased["amplitude"] == 0.2
    noise = load_rig("paper_high_impedance").sensors["ft"].noise
    assert predict(hum(1.0), record)["ft"].rms_error == pytest.approx(noise, rel=0.05)
