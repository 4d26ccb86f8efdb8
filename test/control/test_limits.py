"""What the actuator cannot do, and how it feels: against formulas written out here."""

import math

import numpy as np
import pytest

from rsea_ros.control.controller import Limits
from rsea_ros.control.impedance import impedance
from rsea_ros.control.large_signal import largest, reach
from rsea_ros.control.law import Gains
from rsea_ros.control.synthesis import Design
from rsea_ros.control.trials import sine
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
J, B, K, B_S = 0.957 + 0.953 / 502**2 * 0.0, 23.088, 1530.456, 3.0
GAINS = Gains(1.469, 0.01116, 89.2)
HZ = np.geomspace(0.1, 120.0, 40)


def test_without_gains_the_motor_is_an_inertia_behind_the_spring():
    s = 2j * np.pi * HZ
    series = 1.0 / (1.0 / (J * s + B) + s / (K + B_S * s))
    off = impedance(RIG, 280.0, Gains(0.0, 0.0, 1e-6), HZ)
    assert off.controlled == pytest.approx(-series, rel=1e-3)
    assert off.motor_off == pytest.approx(-series, rel=1e-3)
    assert off.spring == pytest.approx(-(K / s + B_S), rel=1e-12)


def test_control_feels_softer_than_the_spring_up_to_its_bandwidth():
    felt = impedance(RIG, 280.0, GAINS, HZ)
    slow = HZ < 3.0
    assert np.all(np.abs(felt.controlled[slow]) < 0.6 * np.abs(felt.motor_off[slow]))
    assert np.abs(felt.controlled[0]) == pytest.approx(B / (1.0 + GAINS.k_p), rel=0.02)


def test_reach_is_where_the_motor_has_no_more():
    """|T_m| = A |J s^2 + (b_m + b_s) s + K| / |b_s s + K|."""
    found = reach(RIG, 20.0, 44.2, 3.466)
    s = 2j * math.pi * found.torque
    assert 20.0 * abs((J * s * s + (B + B_S) * s + K) / (B_S * s + K)) == pytest.approx(44.2, rel=5e-3)
    s = 2j * math.pi * found.speed
    assert 20.0 * abs(s / (B_S * s + K)) == pytest.approx(3.466, rel=5e-3)
    assert largest(RIG, found.torque, 44.2, 3.466) == pytest.approx(20.0, rel=5e-3)


def test_the_simulated_actuator_stops_following_there():
    design = Design(GAINS, 280.0, {}, math.nan)
    edge = reach(RIG, 40.0, 50.0, math.inf).torque
    limits = Limits(torque=50.0)
    below, above = (sine(RIG, RIG, design, 40.0, share * edge, limits) for share in (0.85, 1.3))
    assert below < 0.06 and above > 4.0 * below
