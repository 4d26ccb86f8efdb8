"""Remarks of a fit and faults of the data in words."""

from typing import get_args

import pytest

from rsea_ros.identification.result import Code, Remark
from rsea_ros.records.record import Fault
from rsea_ros.report.remark_words import fault_lines, found_faults, remark_sentences

SAID = {
    Remark("even_clocks", ("command", "ft"), (1.7e-4, 2.5e-3)): "by 0.17 ms RMS and ft by 2.5 ms RMS.",
    Remark("clocks_taken_as_right", ("spring.stiffness",), (3.04,)): "the interval of spring.stiffness would "
    "be 3.0 times as wide.",
    Remark("torque_by_motor_constant"): "only through the motor constant:",
    Remark("torque_by_loop_gains"): "only through the loop's gains,",
    Remark("at_bound", ("backlash.gap",), (0.05,), "rad"): "backlash.gap ran to its bound, 0.05 rad:",
    Remark("not_shown", ("torque_saturation.limit",)): "data: they do not show it. Measure it separately",
    Remark("only_prior", ("spring.damping",)): "the rig's prior. Excitation above the resonance,",
    Remark("only_ratios", ("a", "b")): "Only ratios of a and b are identifiable",
    Remark("only_together", ("a", "b", "c")): "a, b and c are identifiable from these data only together",
    Remark("play_undetermined", values=(4e-3, 0.012)): "with 4 mrad, which fits best, the residual of data "
    "that took no part changes by -1.2 %.",
    Remark("also_in_model", ("ft_bias",)): "The extended model also has F/T bias:",
    Remark("coherence_lost", ("ft",), (83.2,), "Hz"): "Above 83.2 Hz the coherence of the F/T torque",
    Remark("on_measured_angle"): "on the measured rotor angle:",
    Remark("coloured_noise", ("ft", "position")): "The noise of the F/T torque and position is coloured:",
    Remark("off_rig", ("spring.stiffness",), (1530.456, 1989.61, 1989.53, 1989.69, 5.247), "N m/rad"): "the "
    "rig states 1530 N·m/rad, the fit gives 1989.610 ± 0.080 N·m/rad (95 %), 5.2 of the stated spreads away",
    Remark("differs", ("cold", "spring.damping = 3 N m s/rad", "no backlash")): "cold differs as stated: "
    "spring.damping = 3 N m s/rad and no backlash.",
    Remark("other_records", ("warm", "hot")): "Nothing was fitted to warm and hot, of which the rig has",
    Remark("unseen_spring", values=(71.2, 33.0)): "The mode of rotor and load on the spring, 71.2 Hz",
    Remark("lost_cycles", values=(108.0,)): "108 lost cycles of the driver are a likely cause",
    Remark("stretches", values=(160.1, 600.0), unit="s"): "on 160 s of the 600 s recorded:",
}


@pytest.mark.parametrize(("remark", "text"), SAID.items(), ids=lambda item: getattr(item, "code", ""))
def test_a_remark_is_worded_with_its_names_and_numbers(remark, text):
    (sentence,) = remark_sentences([remark])
    assert text in sentence and sentence.endswith(".")


def test_every_code_has_its_words():
    assert {remark.code for remark in SAID} == set(get_args(Code))


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
    assert found_faults([NAN]) == " Samples were masked: NaN in F/T torque."
    names = "position, velocity and motor torque"
    assert found_faults(DISORDER) == f" The data have faults: out of order in {names}."
    missing = [Fault("missing_topic", name, 1.0) for name in ("velocity", "position", "velocity")]
    assert found_faults(missing) == " The data have faults: velocity and position missing."
    assert found_faults([Fault("pause", "", 0.0)]) == " The data have faults: pause."
    assert found_faults([*DISORDER, NAN]).endswith(" Samples were masked: NaN in F/T torque.")
