"""Bounds and sizes of effects go with the machine."""

import math

import pytest

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.parameter import INERTIA, PERIOD, SPEED, STIFFNESS, TORQUE, Scale, scale_to

REFERENCE = (TORQUE, STIFFNESS, INERTIA, SPEED, PERIOD)


@pytest.mark.parametrize("ratio", [0.51, 1.0, 1.99])
def test_within_a_factor_of_two_the_bounds_are_those_of_the_catalogue(ratio: float):
    assert scale_to(*(ratio * v for v in REFERENCE)) == Scale()


def test_an_unknown_size_of_the_machine_counts_as_that_of_the_catalogue():
    assert scale_to(0.0, math.inf, math.nan, -1.0, 0.0) == Scale()


def test_a_servo_may_have_a_saturation_and_no_friction_of_a_big_machine():
    servo = scale_to(0.08, 4.0, 1e-4, 5.0, 1e-3)
    assert servo == Scale(4.0**-4, 4.0**-4, 4.0**-6, 16.0, 0.25)
    (limit,) = effect_named("torque_saturation").at(servo).parameters
    assert limit.low < 0.05 < limit.high and limit.typical == 15.0 / 256.0
    friction = effect_named("coulomb_friction").at(servo)
    assert friction.main.high == 50.0 / 256.0 and friction.null == effect_named("coulomb_friction").null


@pytest.mark.parametrize(
    ("unit", "expected"),
    [("N m", 4.0), ("N m/rad", 16.0), ("kg m^2", 64.0), ("rad", 0.25), ("1/rad^2", 16.0), ("rad/s", 2.0),
     ("N m s/rad", 2.0), ("N m s^2/rad^2", 1.0), ("1/(N m)", 0.25), ("Hz", 4.0), ("1", 1.0), ("V", 1.0)],
)  # fmt: skip
def test_a_number_scales_with_its_unit(unit: str, expected: float):
    assert Scale(4.0, 16.0, 64.0, 2.0, 0.25).factor(unit) == expected


def test_lags_keep_their_size_and_their_bounds_only_widen():
    for period in (16.0, 1.0 / 16.0):
        (frequency, *_), (lag,) = (
            effect_named(name).at(Scale(period=period)).parameters
            for name in ("structural_resonance", "ft_sensor_lag")
        )
        assert frequency.low <= 2.0 and frequency.high >= 140.0 and frequency.typical == 33.0
        assert lag.low <= 1e-5 and lag.high >= 0.1 and lag.starts == (1e-3, 0.01)


def test_angles_that_do_not_depend_on_the_machine_keep_their_bounds():
    large = Scale(4.0**6, 1.0)
    assert effect_named("backlash").at(large) == effect_named("backlash")
    assert effect_named("torque_ripple").at(large).parameters[2].high == 2.0 * math.pi


def test_bounds_include_what_a_rig_states():
    friction = effect_named("coulomb_friction").at(Scale(4.0**-3))
    assert friction.main.high < 1.0
    assert friction.widen({"torque": 3.0}).main.high == 3.0
    limit = effect_named("torque_saturation")
    assert limit.widen(limit.null) == limit
