"""Limits as tables: readings in, faults out, at the edges too."""

from __future__ import annotations

import math

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.limits import (
    DeviceFault,
    Limits,
    check_limits,
    complaint,
    unmeasured_quantities,
    without,
)
from rsea_ros.hardware.spring_sensor import Spring

ALL = Limits(68.0, deflection=0.25, temperature=60.0, current=12.0, voltage=20.0, velocity=2.0, position=0.5,
             ft=50.0, power=100.0)  # fmt: skip


def reading(position=0.0, velocity=0.0, motor_torque=0.0, **more):
    return State(0, position, velocity, motor_torque, **more)


def wrench(axis, value):
    return tuple(value if k == axis else 0.0 for k in range(6))


EDGES = {
    "deflection of the drive": (lambda v: reading(position=v), 0.25, "deflection", "rad"),
    "deflection by an encoder": (lambda v: reading(position=9.0, deflection=v), 0.25, "deflection", "rad"),
    "temperature": (lambda v: reading(temperature=v), 60.0, "temperature", "°C"),
    "current": (lambda v: reading(current=v), 12.0, "current", "A"),
    "velocity": (lambda v: reading(velocity=v), 2.0, "velocity", "rad/s"),
    "position": (lambda v: reading(position=v, deflection=0.0), 0.5, "position", "rad"),
    "wrench": (lambda v: reading(wrench=wrench(5, v)), 50.0, "ft_torque", "N m"),
    "power": (lambda v: reading(velocity=1.0, motor_torque=v), 100.0, "power", "W"),
}
WIDE = Limits(68.0, deflection=math.inf, temperature=math.inf)


def only(**limits):
    """Limits of which only some are set."""
    return Limits(**{**vars(WIDE), **limits})


@pytest.mark.parametrize("name", EDGES)
def test_a_reading_at_its_limit_is_fine_and_one_beyond_it_is_not(name):
    make, limit, cause, unit = EDGES[name]
    field = {"ft_torque": "ft"}.get(cause, cause)
    limits = only(**{field: limit})
    assert complaint(limits, make(limit)) is None
    beyond = math.nextafter(limit, math.inf)
    assert complaint(limits, make(beyond)) == DeviceFault(cause, beyond, limit, unit)
    if cause != "temperature":
        assert complaint(limits, make(-beyond)) == DeviceFault(cause, beyond, limit, unit), "either way"


def test_a_voltage_at_its_limit_is_fine_and_one_below_it_is_not():
    limits = only(voltage=20.0)
    assert complaint(limits, reading(voltage=20.0)) is None
    assert complaint(limits, reading(voltage=19.9)) == DeviceFault("voltage", 19.9, 20.0, "V", "too low")


DEFAULTS = [
    # just inside the default limit, just outside, cause
    (reading(position=math.radians(4.99)), reading(position=math.radians(5.01)), "deflection"),
    (reading(temperature=69.9), reading(temperature=70.1), "temperature"),
]


@pytest.mark.parametrize(("inside", "outside", "cause"), DEFAULTS)
def test_spring_and_motor_are_guarded_by_default(inside, outside, cause):
    assert complaint(Limits(68.0), inside) is None
    assert complaint(Limits(68.0), outside).cause == cause


@pytest.mark.parametrize(
    "far",
    [
        reading(current=1e9),
        reading(voltage=0.0),
        reading(velocity=1e9),
        reading(position=1e9, deflection=0.0),
        reading(wrench=(1e9,) * 6),
        reading(velocity=1e9, motor_torque=1e9),
    ],
)
def test_a_limit_of_the_machine_that_nobody_states_trips_nothing(far):
    assert complaint(Limits(68.0), far) is None


MEASURED = {"temperature": 30.0, "current": 1.0, "voltage": 24.0}


@pytest.mark.parametrize(
    ("limits", "measured", "lacking"),
    [
        (ALL, MEASURED, []),
        (ALL, {}, ["temperature", "current", "voltage"]),
        (ALL, {"temperature": 30.0, "voltage": 24.0}, ["current"]),
        (Limits(68.0), {}, ["temperature"]),  # current and voltage have no limit by default
        (WIDE, {}, []),
    ],
)
def test_a_limited_quantity_that_a_reading_lacks_is_listed(limits, measured, lacking):
    assert unmeasured_quantities(limits, reading(**measured)) == lacking


@pytest.mark.parametrize(
    ("names", "far"),
    [
        (["temperature"], {"temperature": 1e9}),
        (["current"], {"current": 1e9}),
        (["voltage"], {"voltage": 0.0}),
        (["current", "voltage"], {"current": 1e9, "voltage": 0.0}),
    ],
)
def test_a_limit_that_is_lifted_trips_nothing_and_the_others_stay(names, far):
    lifted = without(ALL, names)
    assert complaint(lifted, reading(**(MEASURED | far))) is None
    assert {name for name, limit in vars(ALL).items() if getattr(lifted, name) != limit} == set(names)


@pytest.mark.parametrize("axis", range(6))
def test_the_torque_is_that_about_the_axis_of_the_actuator(axis):
    for place in range(6):
        fault = complaint(only(ft=50.0, ft_axis=axis), reading(wrench=wrench(place, 51.0)))
        assert (fault is not None) == (place == axis)


def test_the_axis_is_z_by_default():
    assert complaint(only(ft=50.0), reading(wrench=wrench(5, 51.0))).cause == "ft_torque"


@pytest.mark.parametrize("name", ["position", "velocity", "motor_torque"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_reading_that_is_no_number_is_a_fault_with_its_values(name, value):
    fault = complaint(WIDE, reading(**{name: value}))
    assert fault.cause == "reading"
    assert f"{value}" in fault.detail and "expected finite values" in fault.detail


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
def test_a_deflection_that_is_not_measured_makes_no_wrench(nothing):
    """An infinite one made an infinite wrench."""
    assert Spring(1500.0).with_wrench(reading(deflection=nothing)).wrench is None
    assert Spring(1500.0).with_wrench(reading(deflection=0.01)).wrench[5] == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("more", "cause"),
    [
        ({"hardware_error": "a", "motor_trouble": "b", "ft_trouble": "c"}, "hardware_error"),
        ({"motor_trouble": "b", "ft_trouble": "c", "temperature": 99.0}, "motor_state"),
        ({"ft_trouble": "c", "temperature": 99.0, "voltage": 1.0}, "ft"),
        ({"position": 1.0, "temperature": 99.0, "voltage": 1.0}, "deflection"),
        ({"temperature": 99.0, "voltage": 1.0}, "temperature"),
        ({"voltage": 1.0}, "voltage"),
    ],
)
def test_a_fault_of_the_device_comes_before_a_measured_one(more, cause):
    assert complaint(ALL, reading(**more)).cause == cause


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (DeviceFault("heldup"), "heldup:"),
        (DeviceFault("ft", detail="saturation"), "ft: saturation"),
        (DeviceFault("power", 120.0, 100.0, "W"), "power: 120 W, limit 100 W"),
        (DeviceFault("voltage", 19.0, 20.0, "V", "too low"), "voltage: 19 V, limit 20 V too low"),
    ],
)
def test_a_fault_is_described_with_value_limit_and_unit(fault, text):
    assert str(fault) == text


def test_a_fault_without_a_measured_value_has_no_unit():
    bare = DeviceFault("heldup")
    assert math.isnan(bare.value) and math.isnan(bare.limit) and (bare.unit, bare.detail) == ("", "")


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        (Limits(68.0, deflection=0.0454), None),
        (Limits(68.19), None),  # the motor's limit itself, as its register rounds it
        (Limits(68.19 * (1.0 + 5e-10)), None),
        (Limits(68.2), r"torque_limit = 68\.2 N·m, expected at most 68\.19 N·m, the motor's own limit"),
        (Limits(68.0, deflection=0.0453), r"by 0\.04533 rad, expected at most .* = 0\.0453 rad"),
    ],
)
def test_limits_fit_the_motor_and_the_spring(limits, message):
    if message is None:
        return check_limits(limits, 68.19, 1500.0)
    with pytest.raises(ParameterError, match=message):
        check_limits(limits, 68.19, 1500.0)


def test_a_torque_that_deflects_the_spring_to_its_limit_is_allowed():
    check_limits(Limits(64.0, deflection=0.25), 64.0, 256.0)
