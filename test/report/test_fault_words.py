"""Faults of the data in words: one of several channels is said once; only masked samples are called so."""

from __future__ import annotations

from rsea_ros.records.record import Fault
from rsea_ros.report.remark_words import fault_lines, found_faults

DISORDER = [
    Fault("out_of_order", name, 0.05, "first at 0.4 s, sorted", 84, "samples")
    for name in ("position", "velocity", "motor_torque")
]
NAN = Fault("nan", "ft", 0.01)


def test_a_fault_of_a_topic_is_one_line_for_all_its_channels():
    assert fault_lines([*DISORDER, NAN]) == [
        "out of order in position, velocity and motor torque, 84 samples, 5.0 % of the samples "
        "(first at 0.4 s, sorted)",
        "NaN in F/T torque, 1.0 % of the samples",
    ]


def test_faults_of_other_size_stay_apart():
    other = Fault("out_of_order", "ft", 0.05, "first at 0.4 s, sorted", 90, "samples")
    assert len(fault_lines([*DISORDER, other])) == 2
    missing = [Fault("missing_topic", name, 1.0) for name in ("velocity", "position")]
    assert fault_lines(missing) == ["velocity and position are missing"]


def test_a_channel_that_two_records_lack_is_named_once():
    missing = [Fault("missing_topic", name, 1.0) for name in ("velocity", "position")]
    assert fault_lines([*missing, *missing]) == ["velocity and position are missing"]
    assert fault_lines([missing[0], missing[0]]) == ["velocity is missing"]
    assert fault_lines([NAN, NAN]) == ["NaN in F/T torque, 1.0 % of the samples"]


def test_only_what_is_masked_is_called_masked():
    assert found_faults([NAN]) == " Samples were masked: nan in F/T torque."
    names = "position, velocity and motor_torque"
    assert found_faults(DISORDER, str) == f" The data have faults: out of order in {names}."
    missing = [Fault("missing_topic", name, 1.0) for name in ("velocity", "position", "velocity")]
    assert found_faults(missing, str) == " The data have faults: velocity and position missing."
    assert found_faults([*DISORDER, NAN], str).endswith(" Samples were masked: nan in ft.")
