"""The elastic element: Eq. (9) is the slope of Eq. (8), and can be turned round."""

import math

import pytest
from hypothesis import given, strategies as st

from rsea_ros.design.mechanism import spring_radius, spring_rate
from rsea_ros.errors import ParameterError
from rsea_ros.paper.formulas import eq_8_spring_torque, eq_9_spring_stiffness

RATE, LENGTH, ANGLE = st.floats(1e3, 1e6), st.floats(1e-3, 0.2), st.floats(-0.7, 0.7)


@given(RATE, LENGTH, LENGTH, ANGLE)
def test_stiffness_is_the_slope_of_the_torque(k, radius, r_s, theta):
    step = 1e-5
    ahead, behind = (eq_8_spring_torque(k, radius, r_s, theta + d) for d in (step, -step))
    stiffest = eq_9_spring_stiffness(k, radius, r_s)
    assert eq_9_spring_stiffness(k, radius, r_s, theta) == pytest.approx(
        (ahead - behind) / (2 * step), abs=1e-8 * stiffest
    )


@given(RATE, LENGTH, LENGTH)
def test_radius_and_rate_solve_eq_9(k, radius, r_s):
    k_s = eq_9_spring_stiffness(k, radius, r_s)
    assert spring_rate(k_s, radius, r_s) == pytest.approx(k)
    assert spring_radius(k_s, k, radius) ** 2 == pytest.approx(r_s**2, abs=1e-9 * (radius**2 + r_s**2))


def test_stiffness_is_nearly_constant_within_the_travel():
    """Section 3.1.2: less than 5 degrees either way keeps the joint linear to 1.5 %."""
    ends = eq_9_spring_stiffness(207350.0, 0.0635, 0.0115, math.radians(5.0))
    assert 0.984 < ends / eq_9_spring_stiffness(207350.0, 0.0635, 0.0115) < 0.986


def test_a_spring_softer_than_its_arm_is_refused():
    with pytest.raises(ParameterError, match=r"K_s = 100 N·m/rad, expected at least 2 K R\^2 = 1672"):
        spring_radius(100.0, 207350.0, 0.0635)
