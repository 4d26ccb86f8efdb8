"""The outer impedance loop: the impedance felt is that of the linear model, and passive as far as stated."""

import math

import numpy as np
import pytest

from bench.control.human import Virtual, felt_impedance, measure_impedance, passive_to, stiffest
from rsea_ros.control.law import Gains
from rsea_ros.control.margins import distal_responses
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
DESIGN = ControllerDesign(Gains(0.2575, 0.003029, 1.195, 6.99, 42.9), 280.0, {}, math.nan)
HZ = np.array([1.0, 5.0, 10.0, 20.0])


def test_a_hand_feels_hardly_more_than_the_spring_and_what_the_formula_says():
    alone = Virtual(0.0, 0.0)
    z = measure_impedance(RIG, DESIGN, alone, HZ)
    assert np.abs(z) == pytest.approx(np.abs(felt_impedance(RIG, DESIGN, alone, HZ)), rel=0.03)
    assert np.all(np.abs(z) / np.abs(distal_responses(RIG, 280.0, HZ).spring) < 1.23)
    assert np.all(z.real > 0.0)


def test_a_virtual_spring_is_felt_and_is_passive():
    spring = Virtual(200.0, 2.0)
    z = measure_impedance(RIG, DESIGN, spring, HZ[:1])
    assert z == pytest.approx(felt_impedance(RIG, DESIGN, spring, HZ[:1]), rel=0.05)
    more = z[0] - felt_impedance(RIG, DESIGN, Virtual(0.0, 0.0), HZ[:1])[0]
    assert more.imag == pytest.approx(-200.0 / (2.0 * math.pi), rel=0.05)
    assert more.real == pytest.approx(2.0, abs=0.5)


def test_the_stiffest_spring_is_the_last_that_is_passive():
    most = stiffest(RIG, DESIGN, 2.0, 20.0)
    assert 200.0 < most < RIG["spring.stiffness"]
    assert passive_to(RIG, DESIGN, Virtual(0.98 * most, 2.0)) >= 20.0
    assert passive_to(RIG, DESIGN, Virtual(1.05 * most, 2.0)) < 20.0
