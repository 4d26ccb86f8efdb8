"""The set of benches from a file and from a fit's intervals, and friction that makes no limit cycle."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control.controller import TorqueController
from rsea_ros.control.following import closed_loop
from rsea_ros.control.law import Gains
from rsea_ros.control.uncertainty import Uncertainty, assumed, load_uncertainty
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")


def test_a_file_states_what_it_knows_and_leaves_the_rest(tmp_path):
    path = tmp_path / "set.yaml"
    path.write_text(
        "stiffness: 0.05\ndelay: {value: 2, unit: ms}\nlate_samples: 2\n"
        "mode: {frequency: {value: 33, unit: Hz}, damping_ratio: 0.02, participation: 0.3}\n"
    )
    stated = load_uncertainty(path, RIG, 280.0)
    assert stated == Uncertainty(0.05, 0.5, 0.0, 2, 2e-3, (33.0, 0.02, 0.3))
    assert "33 Hz" in str(stated) and "2 samples late" in str(stated)


@pytest.mark.parametrize(("text", "told"), [
    ("delay: {value: 2, unit: m}", r"line 1: delay.unit = 'm', expected 's'"),
    ("stiffness: 2", r"line 1: stiffness = 2, expected 0 to 0.9"),
    ("stifness: 0.1", r"unknown key 'stifness'"),
    ("late_samples: 0.5", r"late_samples = 0.5, expected a whole number"),
    ("mode: {frequency: {value: 33, unit: Hz}}", r"mode.damping_ratio"),
    ("- 1", r"expected a mapping"),
])  # fmt: skip
def test_what_is_wrong_in_a_file_is_told_in_one_line(tmp_path, text, told):
    path = tmp_path / "set.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=told) as refused:
        load_uncertainty(path, RIG, 280.0)
    assert "\n" not in str(refused.value) and str(path) in str(refused.value)


def test_a_fit_states_its_interval_and_timing_scales_with_the_actuator():
    k = RIG["spring.stiffness"]
    fitted = {**RIG.quantities}
    fitted["spring.stiffness"] = replace(fitted["spring.stiffness"], ci95=(0.96 * k, 1.03 * k))
    narrow = assumed(replace(RIG, quantities=fitted), 280.0)
    assert narrow.stiffness == pytest.approx(0.04) and narrow.damping == 0.5
    assert assumed(RIG, 280.0).delay == 0.0 and assumed(RIG, 1000.0).delay == pytest.approx(0.96e-3, rel=0.01)
    assert assumed(RIG, 280.0).mode is None


@pytest.mark.parametrize(("gains", "least", "most"), [
    (Gains(1.0, 0.0223, 12.9, 2.78, 20.3), 0.1, 0.5),  # an integral and an observer below 3 Hz: they hunt
    (Gains(1.1, 0.0307, 14.2, 0.006, 4.8), 0.0, 0.02),  # those of the design
])  # fmt: skip
def test_friction_makes_a_limit_cycle_where_the_gears_response_is_negative(gains, least, most):
    """The amplitude of the first is that of the describing function, 0.47 N m for 2 N m of friction."""
    rough = RIG.with_effect("coulomb_friction", torque=2.0)
    wanted = 5.0 * np.minimum(1.0, np.arange(2240) / 140.0)
    run = closed_loop(rough, 280.0, TorqueController(RIG, 280.0, gains), wanted, noise=False)
    assert least <= float(np.std(run.ft[1400:])) <= most and math.isfinite(run.command[-1])
