"""A diagnosis in sentences: how sure a cause is, and the next run."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import pytest

from rsea_ros.diagnosis.result import Alternative, Cause, CauseParameter, Experiment, ExperimentReason
from rsea_ros.report.diagnosis.files import diagnosis_json
from rsea_ros.report.diagnosis.page import diagnosis_report
from rsea_ros.report.diagnosis.words import next_run, status_line

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


DELAY = Cause(
    "command_delay",
    {"delay": CauseParameter(9.1e-3, "s", (8.4e-3, 9.8e-3))},
    0.4,
    0.4,
    (0.3, 0.5),
    (2.0, 1.2),
    status="leading",
    probability=0.87,
)
GAIN = replace(
    DELAY,
    name="ft_gain_error",
    parameters={"gain": CauseParameter(0.891, "1", (0.886, 0.896))},
    status="one_of",
    probability=0.55,
)
CONSTANT = Alternative(
    "torque_constant_error",
    "ft_gain_error",
    {"gain": CauseParameter(1.12, "1", (1.11, 1.13))},
    0.39,
    (0.3, 0.5),
    "ft",
    0.4,
)


def test_a_leading_cause_has_size_interval_and_probability():
    assert status_line(DELAY) == (
        "leading: command_delay 9.10 ms [8.40, 9.80], probability 0.87; "
        "it certainly helps on held-out data, but part of the misfit remains"
    )


def test_one_of_names_its_rival_with_its_size():
    assert status_line(GAIN, (CONSTANT,)) == (
        "one of: ft_gain_error 0.891 [0.886, 0.896], probability 0.55 or "
        "torque_constant_error 1.12 [1.11, 1.13], probability 0.40; these data do not distinguish them"
    )
    assert status_line(DELAY, (CONSTANT,)) == status_line(DELAY)


def test_file_and_page_carry_status_probability_and_alternatives(diagnosed):
    assert diagnosed.diagnosis.causes[0].status == "confirmed"
    doubted = replace(
        diagnosed.diagnosis, verdict="partly_explained", causes=(GAIN,), alternatives=(CONSTANT,)
    )
    document = diagnosis_json(doubted)
    (cause,), (other,) = document["causes"], document["alternatives"]
    assert (cause["status"], cause["probability"]) == ("one_of", 0.55)
    assert (other["name"], other["instead_of"], other["probability"]) == (
        "torque_constant_error",
        "ft_gain_error",
        0.4,
    )
    assert other["parameters"]["gain"]["ci95"] == [1.11, 1.13]
    assert other["gain"]["holdout"] == 0.39
    assert "One of: F/T gain error 0.891" in diagnosis_report(doubted)
