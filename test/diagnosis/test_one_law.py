"""Effects that are one law in the band of a record are named together, not one of them alone."""

from __future__ import annotations

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.excitations import RATE
from independent.hidden import hide
from independent.severities import drawn_parameters

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig_file import load_rig

ALIKE = {"structural_resonance", "base_compliance"}
OTHERS = {
    "current_loop_overshoot", "gear_compliance", "ft_gain_error", "torque_constant_error",
    "encoder_eccentricity", "torque_constant_drift", "stiffness_drift", "torque_ripple",
}  # fmt: skip
WITHOUT = tuple(n for n in catalogue() if n not in ALIKE | OTHERS)


def slow_sweep(duration: float) -> np.ndarray:
    """Return a sine of 30 N m from 0.1 to 10 Hz."""
    t = np.arange(round(duration * RATE)) / RATE
    growth = np.log(100.0) / duration
    return 30.0 * np.sin(2.0 * np.pi * 0.1 * np.expm1(growth * t) / growth)


def test_a_mode_above_the_band_is_one_of_the_two_effects_that_make_one():
    rng = np.random.default_rng([5, *map(ord, "structural_resonancesweepmedium")])
    parameters = drawn_parameters("structural_resonance", "medium", rng)
    assert parameters["frequency"] > 60.0
    bench = hide(drawn_bench(rng), "structural_resonance", parameters)
    record = record_command(bench, slow_sweep(20.0), rng)
    diagnosis = diagnose(
        [record], load_rig("paper_high_impedance"), settings=DiagnosisSettings(without=WITHOUT)
    )
    (cause,) = diagnosis.causes
    assert cause.status in ("one_of", "leading")  # at the edge: 1.036 times the noise without it
    assert {cause.name, *(a.name for a in diagnosis.alternatives)} == ALIKE
