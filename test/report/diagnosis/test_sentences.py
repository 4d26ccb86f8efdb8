"""The next run in a sentence: what it would decide, or why none is recommended."""

from __future__ import annotations

from typing import get_args

import pytest

from rsea_ros.diagnosis.result import Experiment, ExperimentReason
from rsea_ros.report.diagnosis.words import next_run

RUN = {"kind": "multisine"}
SAID = {
    "separates": (
        Experiment("separates", "backlash", ("hard_stop",), 3.21, excitation=RUN),
        "backlash and hard_stop do as well on these data; "
        "this run makes them differ by 3.2 times the noise",
    ),
    "inseparable": (
        Experiment("inseparable", "ft_gain_error", ("torque_constant_error", "ft_bias"), 0.042),
        "ft_gain_error and torque_constant_error and ft_bias make the same motion under every excitation "
        "tried within the limits of rig and driver (at most 0.04 times the noise apart): only a separate "
        "measurement distinguishes them, such as the spring stiffness by a known weight",
    ),
    "other_amplitude": (
        Experiment("other_amplitude", "backlash", ("hard_stop",)),
        "backlash and hard_stop do as well on these data; a run at another amplitude would show more",
    ),
    "amplitude_series": (
        Experiment("amplitude_series", amplitude=2.0, excitation=RUN),
        "nothing in the catalogue explains what is left: repeat at twice the amplitude with an odd "
        "multisine, whose empty lines show distortion apart from noise; what scales with the command is "
        "linear, what does not is friction-like",
    ),
}


@pytest.mark.parametrize("reason", get_args(ExperimentReason))
def test_every_reason_has_a_sentence(reason):
    experiment, sentence = SAID[reason]
    assert next_run(experiment) == sentence


def test_without_a_run_no_multisine_is_mentioned():
    assert "at half the amplitude; what scales" in next_run(Experiment("amplitude_series", amplitude=0.5))
