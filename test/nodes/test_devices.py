"""Limits from parameters: for every rig, and refused where a limit cannot be applied."""

import math

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.nodes import driver
from rsea_ros.nodes._devices import limits_of

DEFAULTS = {parameter.name: parameter.default for parameter in driver.TABLE}


def limits(**values):
    return limits_of(DEFAULTS | values)


def test_the_default_slew_limit_limits_within_a_cycle():
    """40 000 N m/s were 142 N m a cycle at 280 Hz."""
    assert limits().slew / DEFAULTS["rate"] < DEFAULTS["torque_limit"]
    assert limits().soft_start / DEFAULTS["rate"] < 2.0


@pytest.mark.parametrize(("rate", "cycles"), [(280.0, 3), (1000.0, 10), (100.0, 3)])
def test_replies_may_be_lost_for_the_same_time_at_any_rate(rate, cycles):
    """Three cycles at 1 kHz are 3 ms: any stall of the line was a fault, and 1 kHz never drove."""
    assert limits(rate=rate).lost_cycles == cycles


def test_a_spring_with_a_free_end_is_limited_by_what_ft_measures():
    clamped, free = limits(), limits(rig="paper_moving_output", deflection_limit=0.05)
    assert (clamped.deflection, clamped.ft) == (0.0873, 110.0)
    assert math.isinf(free.deflection) and free.ft == pytest.approx(0.05 * 1530.456)


def test_an_angle_that_counts_from_the_motors_zero_is_not_the_springs():
    """The limit of the deflection was that of the joint: one way twice as far, the other not at all."""
    own_limits = limits(device="dynamixel_netft", position_zero="motor", deflection_limit=0.05)
    assert math.isinf(own_limits.deflection) and own_limits.ft == pytest.approx(0.05 * 1530.456)
    felt = limits(device="dynamixel_netft", position_zero="motor", encoder_id=5, ft_host="")
    assert felt.deflection == 0.0873
    with pytest.raises(ParameterError, match=r"deflection_limit = 0\.05 cannot be applied"):
        limits(device="dynamixel_netft", position_zero="motor", ft_host="", deflection_limit=0.05)


def test_velocity_power_and_ft_are_limited_by_default_on_every_rig():
    for rig in ("paper_high_impedance", "paper_moving_output", "prototype_knee"):
        bounds = limits(rig=rig)
        assert math.isfinite(bounds.velocity + bounds.power + bounds.ft + bounds.effort)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"rig": "bare_drive"}, "deflection_limit = 0.0873 cannot be applied to rig bare_drive"),
        ({"rig": "bare_drive", "deflection_limit": 0.0}, "ft_limit = 110 cannot be applied"),
        ({"rig": "paper_moving_output", "device": "dynamixel_netft", "ft_host": ""},
         "deflection_limit = 0.0873 cannot be applied to rig paper_moving_output"),
    ],
)  # fmt: skip
def test_a_limit_that_cannot_be_applied_is_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        limits(**values)


def test_zero_is_no_limit():
    free = limits(temperature_limit=0.0, current_limit=0.0, voltage_limit=0.0)
    assert (free.temperature, free.current, free.voltage) == (math.inf, math.inf, 0.0)


def test_a_bare_drive_has_the_limits_that_apply_to_it():
    bounds = limits(rig="bare_drive", deflection_limit=0.0, ft_limit=0.0, position_limit=0.5)
    assert bounds.position == 0.5 and math.isinf(bounds.ft) and math.isfinite(bounds.velocity)
