"""Cogging that holds the rotor: simulated, a 502:1 gear settles in other detents than the real one."""

from __future__ import annotations

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import hide

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import remark_sentences


def test_strong_cogging_is_named_with_its_size():
    """A free simulation left 120 times the noise, and the verdict was `unexplained`."""
    amplitude, cycles, rng = 4.0, 8.0, np.random.default_rng(2)
    phase = float(rng.uniform(-3.0, 3.0))
    ripple = {"amplitude": amplitude, "cycles_per_revolution": cycles, "phase": phase}
    record = record_run(hide(drawn_bench(rng), "torque_ripple", ripple), 2001, "chirp_noise", 6.0)
    diagnosis = diagnose([record], load_rig("paper_high_impedance"))
    assert diagnosis.causes[0].name == "torque_ripple"
    sizes = diagnosis.causes[0].parameters
    assert sizes["amplitude"].value == pytest.approx(amplitude, rel=0.02)
    assert sizes["cycles_per_revolution"].value == pytest.approx(cycles, rel=0.001)
    assert diagnosis.causes[0].gain_holdout > 0.9
    assert any("measured rotor angle" in sentence for sentence in remark_sentences(diagnosis.remarks))
