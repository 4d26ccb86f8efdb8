"""The model's simulation and the second bench agree, effect by effect, though they share no code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from independent.bench import record_run
from independent.hidden import CATALOGUE, hide
from independent.plant import Bench
from independent.severities import drawn_parameters

from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate

NOISE = {"ft": 0.03, "position": 3.7e-6, "velocity": 2.1e-4, "motor_torque": 0.052}
QUIET = dict.fromkeys(
    ("ft_noise", "position_quantum", "velocity_noise", "velocity_quantum", "motor_noise", "motor_quantum"),
    0.0,
)
OF_THE_MODEL = {
    "base_compliance": {"damping_ratio": Bench().plant.base_zeta},
    "mains_interference": {"phase": 0.0},
}
"""Parameters that the model has and the contract doesn't name."""


@pytest.mark.parametrize("effect", [None, *CATALOGUE])
def test_both_implementations_agree(effect):
    """Within 6 % of the effect's own change, or half of the sensor's noise, RMS, after 0.3 s."""
    parameters = drawn_parameters(effect, "medium", np.random.default_rng(3)) if effect else {}
    bench = hide(Bench(), effect, parameters) if effect else Bench()
    hidden, plain = (
        record_run(b.with_values(**QUIET, hum_phase=0.0), 5, duration=12.0) for b in (bench, Bench())
    )
    rig = load_rig("paper_high_impedance")
    if effect:
        setting = EffectSetting(effect, {**parameters, **OF_THE_MODEL.get(effect, {})})
        rig = replace(rig, effects=(setting,))
    for name, y in simulate(rig, hidden).items():
        apart = _rms(y - hidden[name].y)
        assert apart <= max(0.06 * _rms(plain[name].y - hidden[name].y), 0.5 * NOISE[name]), name


def _rms(y):
    return float(np.sqrt(np.mean(y[84:] ** 2)))
