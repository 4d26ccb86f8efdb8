"""Limits of the actuator, and what a hand feels: against formulas written out here and the linear model."""

import math

import numpy as np
import pytest

from bench.control.human import Virtual, felt_impedance, measure_impedance, passive_to, stiffest
from rsea_ros.control.controller import TorqueLimits
from rsea_ros.control.law import Gains
from rsea_ros.control.margins import distal_responses, impedance
from rsea_ros.control.robustness import largest, reach
from rsea_ros.control.study import sine
from rsea_ros.model.rig_file import load_rig
from test.control.benches import DESIGN, GAINS, RATE, RIG

J, B, K, B_S = 0.957 + 0.953 / 502**2 * 0.0, 23.088, 1530.456, 3.0
HZ = np.geomspace(0.1, 120.0, 40)
ALONE, FELT = Virtual(0.0, 0.0), np.array([1.0, 5.0, 10.0, 20.0])


def test_without_gains_the_motor_is_an_inertia_behind_the_spring():
    s = 2j * np.pi * HZ
    series = 1.0 / (1.0 / (J * s + B) + s / (K + B_S * s))
    off = impedance(RIG, RATE, Gains(0.0, 0.0, 0.0, 1e-6, 0.0), HZ)
    assert off.controlled == pytest.approx(-series, rel=1e-3)
    assert off.motor_off == pytest.approx(-series, rel=1e-3)
    assert off.spring == pytest.approx(-(K / s + B_S), rel=1e-12)


def test_control_feels_soft_where_it_is_slow_and_hardly_stiffer_than_the_spring_anywhere():
    felt = impedance(RIG, RATE, GAINS, HZ)
    assert np.abs(felt.controlled / felt.spring).max() < 1.21
    assert np.all(np.abs(felt.controlled[HZ < 0.7]) < 0.8 * np.abs(felt.motor_off[HZ < 0.7]))
    assert np.abs(felt.controlled[0]) < 0.6 * B


def test_the_reach_ends_at_the_torque_limit_of_the_motor():
    """|T_m| = A |J s^2 + (b_m + b_s) s + K| / |b_s s + K|."""
    reached = reach(RIG, 20.0, 44.2, 3.466)
    s = 2j * math.pi * reached.torque
    assert 20.0 * abs((J * s * s + (B + B_S) * s + K) / (B_S * s + K)) == pytest.approx(44.2, rel=5e-3)
    s = 2j * math.pi * reached.speed
    assert 20.0 * abs(s / (B_S * s + K)) == pytest.approx(3.466, rel=5e-3)
    assert largest(RIG, reached.torque, 44.2, 3.466) == pytest.approx(20.0, rel=5e-3)


def test_the_simulated_actuator_stops_following_at_its_reach():
    edge, limits = reach(RIG, 40.0, 50.0, math.inf).torque, TorqueLimits(torque=50.0)
    below, above = (sine(RIG, RIG, DESIGN, 40.0, share * edge, limits) for share in (0.85, 1.3))
    assert below < 0.06 and above > 4.0 * below


def test_a_controller_takes_the_torque_of_the_motor_that_its_rig_states():
    assert TorqueLimits.of(RIG).torque == 68.0
    assert TorqueLimits.of(RIG.with_effect("torque_saturation", limit=12.0)).torque == 12.0
    assert TorqueLimits.of(load_rig("pd_joint")).torque == load_rig("pd_joint")["controller.torque_limit"]


def test_a_hand_feels_hardly_more_than_the_spring_and_what_the_formula_says():
    z = measure_impedance(RIG, DESIGN, ALONE, FELT)
    assert np.abs(z) == pytest.approx(np.abs(felt_impedance(RIG, DESIGN, ALONE, FELT)), rel=0.03)
    assert np.all(np.abs(z) / np.abs(distal_responses(RIG, RATE, FELT).spring) < 1.23)
    assert np.all(z.real > 0.0)


def test_a_virtual_spring_is_felt_and_is_passive():
    spring = Virtual(200.0, 2.0)
    z = measure_impedance(RIG, DESIGN, spring, FELT[:1])
    assert z == pytest.approx(felt_impedance(RIG, DESIGN, spring, FELT[:1]), rel=0.05)
    more = z[0] - felt_impedance(RIG, DESIGN, ALONE, FELT[:1])[0]
    assert more.imag == pytest.approx(-200.0 / (2.0 * math.pi), rel=0.05)
    assert more.real == pytest.approx(2.0, abs=0.5)


def test_the_stiffest_spring_is_the_last_that_is_passive():
    most = stiffest(RIG, DESIGN, 2.0, 20.0)
    assert 200.0 < most < RIG["spring.stiffness"]
    assert passive_to(RIG, DESIGN, Virtual(0.98 * most, 2.0)) >= 20.0
    assert passive_to(RIG, DESIGN, Virtual(1.05 * most, 2.0)) < 20.0
