"""The band of the set in the plots and its worst cases, against the simulation of a bench of the set."""

import math

import numpy as np
import pytest

from rsea_ros.control.following import fall, follow
from rsea_ros.control.law import Gains
from rsea_ros.control.robustness import NEAR, softness, spread
from rsea_ros.control.study import hard
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.uncertainty import LOCKED, Uncertainty, load_range, mode_of
from rsea_ros.model.rig_file import load_rig

RIG, FREE = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
SET = Uncertainty(delay=2e-3, mode=(33.0, 0.02, 0.3))
DESIGN = ControllerDesign(
    Gains(0.2575, 0.003029, 1.195, 6.99, 42.9), 280.0, {}, math.nan, uncertainty=SET
)
LOADS = load_range(RIG, FREE)


def test_a_simulated_bench_of_the_set_lies_within_the_band():
    """The mode rings in the sensor and not in the torque, so it is taken out of what the sensor read."""
    apart, near = spread(RIG, LOADS, DESIGN, (LOCKED,)), follow(RIG, RIG, DESIGN, learn=False)
    far = follow(hard(LOADS, SET), RIG, DESIGN, late=1, learn=False)
    mode = mode_of(SET.mode, far.hz)
    beyond = 20.0 * np.log10(np.abs(far.torque / mode / near.torque))
    low, high = (np.interp(far.hz, apart.hz, edge) for edge in apart.gain)
    below = far.hz < 60.0  # above, the delay of 2 ms is not that of a held command
    assert np.all((beyond > low - 0.3)[below]) and np.all((beyond < high + 0.3)[below])
    assert beyond[far.hz == 15.0] > 3.0  # no nominal bench in a wide band


def test_the_band_is_about_the_nominal_bench():
    for names in ((LOCKED,), NEAR):
        apart = spread(RIG, LOADS, DESIGN, names)
        for low, high in (apart.gain, apart.phase):
            assert np.all(low <= 1e-9) and np.all(high >= -1e-9)
        assert np.abs(apart.gain[1][0]) < 0.2  # integral action leaves nothing at rest


def test_the_softest_and_stiffest_outputs_enclose_the_nominal_one():
    hz = np.geomspace(0.1, 120.0, 60)
    nominal = softness(RIG, DESIGN, hz)
    assert np.all(nominal.low <= nominal.high) and 1.2 < nominal.worst < 3.0


@pytest.mark.parametrize(("gain", "expected"), [
    ([0.0, -1.0, -5.0], 20.0 * 2.0**0.5), ([0.0, -1.0, -2.0], math.inf), ([-9.0, -9.0, -9.0], 0.0),
    ([-9.0, 1.0, -7.0], 20.0 * 2.0**0.5),
])  # fmt: skip
def test_a_bandwidth_lies_between_the_sines(gain, expected):
    assert fall(np.array([10.0, 20.0, 40.0]), np.array(gain)) == pytest.approx(expected)
