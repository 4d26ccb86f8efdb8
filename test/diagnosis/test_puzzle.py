"""The paper's own puzzle (section 3.2.2): out of sync at 19 Hz, a bump at 33 Hz. A resonance, or a delay?"""

from __future__ import annotations

import pytest
from independent.puzzle import DELAY, RESONANCE, delayed_record, noisy_resonance

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import remark_sentences


def test_a_resonance_is_found_in_the_noise_and_what_the_noise_hides_is_said():
    diagnosis = diagnose([noisy_resonance(3, 100.0)], load_rig("paper_moving_output"))
    assert [cause.name for cause in diagnosis.causes] == ["structural_resonance"]
    for name in ("frequency", "participation"):
        low, high = diagnosis.causes[0].parameters[name].ci95
        assert low < RESONANCE[name] < high
    lost = next(s for s in remark_sentences(diagnosis.remarks) if "coherence" in s)
    assert float(lost.split()[1]) == pytest.approx(19.0, abs=1.5)


def test_a_delay_of_one_and_a_half_samples_is_no_resonance():
    diagnosis = diagnose([delayed_record(3, 10.0)], load_rig("paper_moving_output"))
    assert [cause.name for cause in diagnosis.causes] == ["command_delay"]
    assert diagnosis.causes[0].parameters["delay"].value == pytest.approx(DELAY, rel=0.02)
