"""How sure a diagnosis is of a cause, in a sentence."""

from __future__ import annotations

from dataclasses import replace

from rsea_ros.diagnosis.result import Alternative, Cause, CauseParameter
from rsea_ros.report.diagnosis.files import diagnosis_json
from rsea_ros.report.diagnosis.page import diagnosis_report
from rsea_ros.report.diagnosis.words import status_line

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
