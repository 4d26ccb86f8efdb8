"""Limits as tables: readings in, faults out, at the edges too; a limit of what is not measured any more."""

from __future__ import annotations

import math

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import Spring, State
from rsea_ros.hardware.limits import (
    DeviceFault,
    Guard,
    Limits,
    check_limits,
    complaint,
    unmeasured_quantities,
)

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
    limits = only(**{{"ft_torque": "ft"}.get(cause, cause): limit})
    beyond = math.nextafter(limit, math.inf)
    assert complaint(limits, make(limit)) is None
    assert complaint(limits, make(beyond)) == DeviceFault(cause, beyond, limit, unit)
    if cause != "temperature":
        assert complaint(limits, make(-beyond)) == DeviceFault(cause, beyond, limit, unit), "either way"


def test_a_voltage_at_its_limit_is_fine_and_one_below_it_is_not():
    limits = only(voltage=20.0)
    assert complaint(limits, reading(voltage=20.0)) is None
    assert complaint(limits, reading(voltage=19.9)) == DeviceFault("voltage", 19.9, 20.0, "V", "too low")


@pytest.mark.parametrize(
    ("state", "cause"),
    [
        (reading(position=math.radians(4.99)), None),
        (reading(position=math.radians(5.01)), "deflection"),
        (reading(temperature=69.9), None),
        (reading(temperature=70.1), "temperature"),
        (reading(current=1e9), None),
        (reading(voltage=0.0), None),
        (reading(velocity=1e6), None),
        (reading(position=1e6, deflection=0.0), None),
        (reading(wrench=(1e9,) * 6), None),
        (reading(velocity=1e6, motor_torque=1e6), None),
    ],
)
def test_spring_and_motor_are_guarded_by_default_and_nothing_else(state, cause):
    fault = complaint(Limits(68.0), state)
    assert (fault and fault.cause) == cause


NUMBERS = [name for name, value in vars(Limits(68.0)).items() if isinstance(value, (int, float))]


@pytest.mark.parametrize("value", [math.nan, -1.0])
@pytest.mark.parametrize("name", NUMBERS)
def test_a_limit_that_is_no_number_or_negative_is_refused(name, value):
    """NaN is beyond nothing: it limited nothing, in silence."""
    with pytest.raises(ParameterError, match=rf"^limit {name} = {value}, expected a number of at least 0$"):
        only(**{name: value})
    assert len(NUMBERS) == 17


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


@pytest.mark.parametrize("names", [["temperature"], ["current"], ["voltage"], ["current", "voltage"]])
def test_a_limit_that_is_lifted_trips_nothing_and_the_others_stay(names):
    far = {"temperature": 1e9, "current": 1e9, "voltage": 0.0}
    lifted = ALL.without(names)
    assert complaint(lifted, reading(**(MEASURED | {name: far[name] for name in names}))) is None
    assert {name for name, limit in vars(ALL).items() if getattr(lifted, name) != limit} == set(names)


@pytest.mark.parametrize("axis", [None, *range(6)])
def test_the_torque_is_that_about_the_axis_of_the_actuator(axis):
    limits = only(ft=50.0) if axis is None else only(ft=50.0, ft_axis=axis)
    felt = [complaint(limits, reading(wrench=wrench(place, 51.0))) is not None for place in range(6)]
    assert felt == [place == (5 if axis is None else axis) for place in range(6)], "z by default"


@pytest.mark.parametrize("name", ["position", "velocity", "motor_torque"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, -1.1e6])
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


SECOND = 100
"""Cycles of a guard without a measurement that are no fault; one more is."""
COMPLETE = {**MEASURED, "wrench": (0.0,) * 6}
LIMITED = {"ft": 60.0, "temperature": 70.0, "current": 12.0, "voltage": 20.0}
LACKING = {"ft": {"wrench": None}, **{name: {name: math.nan} for name in MEASURED}}
NONE = {"wrench": None, **dict.fromkeys(MEASURED, math.nan)}


def guard(*limited):
    """A guard with limits of some quantities, 100 cycles a second."""
    limits = {"temperature": math.inf, **{name: LIMITED[name] for name in limited}}
    return Guard(Limits(68.0, **limits), 1.0 / SECOND)


def causes(limiter, *readings):
    """Return the cause of the latched fault after each of some readings, None for none."""
    told = []
    for each in readings:
        limiter.look(reading(**{**COMPLETE, **each}))
        told.append(limiter.fault and limiter.fault.cause)
    return told


@pytest.mark.parametrize("others", [{}, NONE])
@pytest.mark.parametrize("name", LIMITED)
def test_a_limited_quantity_must_go_on_being_measured(name, others):
    """A device whose wrench ceased went on without the limit, and nobody was told."""
    limiter, lacking = guard(name), {**others, **LACKING[name]}
    assert causes(limiter, {}, *[lacking] * (SECOND + 1)) == [None] * (SECOND + 1) + [name]
    quantity = "torque" if name == "ft" else name
    assert str(limiter.fault) == f"{name}: no {quantity} measured for 1 s, expected one for {name}_limit"


@pytest.mark.parametrize(
    "nothing", [None, wrench(5, math.nan), wrench(5, math.inf)], ids=["none", "nan", "inf"]
)
def test_an_ft_limit_needs_a_torque_also_where_there_never_was_one(nothing):
    """None was a fault after a second; NaN switched the limit off in silence."""
    assert causes(guard("ft"), *[{"wrench": nothing}] * (SECOND + 1)) == [None] * SECOND + ["ft"]


@pytest.mark.parametrize("name", MEASURED)
def test_a_quantity_that_was_never_measured_trips_nothing(name):
    """`GuardedDevice.open` refuses its limit."""
    assert causes(guard(name), *[LACKING[name]] * (SECOND + 50))[-1] is None


@pytest.mark.parametrize("nothing", [math.nan, math.inf])
def test_a_deflection_that_ceases_is_a_fault_and_not_the_drives_angle(nothing):
    limiter = guard()
    felt, blind = ({"position": 9.0, "deflection": value} for value in (0.01, nothing))
    assert causes(limiter, felt, *[blind] * (SECOND + 1)) == [None] * (SECOND + 1) + ["deflection"]
    assert "no deflection measured for 1 s" in str(limiter.fault)


@pytest.mark.parametrize("name", LIMITED)
def test_one_measurement_begins_the_second_anew(name):
    """A sensor that is slower than the cycle is no fault."""
    limiter = guard(*LIMITED)
    for _ in range(3):
        assert causes(limiter, {}, *[LACKING[name]] * SECOND)[-1] is None
    assert causes(limiter, LACKING[name]) == [name]


@pytest.mark.parametrize("name", ["ft", "temperature"])
def test_a_cleared_fault_comes_back_while_nothing_is_measured(name):
    limiter = guard("ft", "temperature")
    causes(limiter, {}, *[LACKING[name]] * (SECOND + 1))
    limiter.clear()
    assert causes(limiter, LACKING[name]) == [name]
    limiter.clear()
    assert causes(limiter, {}) == [None]


def test_a_missing_torque_is_named_before_other_quantities():
    assert causes(guard(*LIMITED), {}, *[NONE] * (SECOND + 1)) == [None] * (SECOND + 1) + ["ft"]


def test_without_its_limit_a_quantity_need_not_be_measured():
    assert causes(guard(), {}, *[NONE] * (SECOND + 50))[-1] is None
