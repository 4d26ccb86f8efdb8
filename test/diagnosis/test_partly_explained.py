"""Where the catalogue lacks one of the laws: a right cause is named, a look-alike is not confirmed."""

from __future__ import annotations

import numpy as np
from independent.bench import drawn_bench, record_run

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig_file import load_rig


def diagnose_bench(tried, duration=10.0, **hidden):
    """Return the diagnosis of a drawn bench with values of its own, by some effects of the catalogue."""
    bench = drawn_bench(np.random.default_rng(3)).with_values(**hidden)
    record = record_run(bench, 5, "chirp_noise", duration)
    without = tuple(n for n in catalogue() if n not in tried)
    return diagnose([record], load_rig("paper_high_impedance"), settings=DiagnosisSettings(without=without))


def test_a_right_cause_is_named_beside_a_law_that_the_catalogue_lacks():
    """A dead band of the drive leaves half of the residual; the right cause then was not named."""
    tried = ("asymmetric_friction", "command_delay", "nonlinear_spring")
    diagnosis = diagnose_bench(tried, friction_offset=0.8, viscous_difference=1.2, deadband=5.0)
    assert diagnosis.verdict == "partly_explained"
    (cause,) = diagnosis.causes
    assert (cause.name, cause.status) == ("asymmetric_friction", "leading")
    assert 0.2 < cause.probability < 0.98
    low, high = cause.parameters["offset"].ci95
    assert low < 0.8 < high
    assert [e.name for e in diagnosis.extended_rig.effects] == ["asymmetric_friction"]
    assert {r.name for r in diagnosis.rejected} == {"command_delay", "nonlinear_spring"}


def test_stribeck_for_coulomb_friction_with_quadratic_drag_is_not_confirmed():
    """It takes nine tenths of the residual; a spline over the speed still gains beside it."""
    diagnosis = diagnose_bench(("stribeck_friction", "coulomb_friction"), coulomb=1.0, quadratic_drag=8.0)
    assert diagnosis.verdict != "explained"
    assert "confirmed" not in {c.status for c in diagnosis.causes if c.name == "stribeck_friction"}
