"""Limits of quantities whose measurement ceases, as tables: readings in, the fault after a second out."""

from __future__ import annotations

import math

import pytest

from rsea_ros.hardware.device import State
from rsea_ros.hardware.limits import Guard, Limits

PERIOD = 0.01
SECOND = 100
"""Cycles without a measurement that are no fault; one more is."""
COMPLETE = {"temperature": 30.0, "current": 1.0, "voltage": 24.0, "wrench": (0.0,) * 6}
LIMITED = {"temperature": 70.0, "current": 12.0, "voltage": 20.0, "ft": 60.0}


def reading(*lacking, **others):
    """Return a reading of all quantities but some."""
    absent = {name: None if name == "wrench" else math.nan for name in lacking}
    return State(0, 0.0, 0.0, 0.0, **{**COMPLETE, **absent, **others})


def fault_after(limiter, *readings):
    """Return the cause of the latched fault after each of some readings, None for none."""
    causes = []
    for each in readings:
        limiter.look(each)
        causes.append(limiter.fault and limiter.fault.cause)
    return causes


def guard(*limited):
    return Guard(Limits(68.0, **{"temperature": math.inf, **{n: LIMITED[n] for n in limited}}), PERIOD)


@pytest.mark.parametrize("others", [(), ("temperature", "current", "voltage")])
@pytest.mark.parametrize("measured_before", [True, False])
def test_an_ft_limit_needs_a_torque_that_is_measured(others, measured_before):
    """A device whose wrench ceased went on without the limit, and nobody was told."""
    limiter = guard("ft")
    if measured_before:
        fault_after(limiter, *[reading(*others)] * 3)
    assert fault_after(limiter, *[reading("wrench", *others)] * SECOND) == [None] * SECOND
    limiter.look(reading("wrench", *others))
    assert str(limiter.fault) == "ft: no torque measured for 1 s, expected one for ft_limit"


@pytest.mark.parametrize("others", [(), ("wrench",)])
@pytest.mark.parametrize("name", ["temperature", "current", "voltage"])
def test_a_limited_quantity_must_go_on_being_measured(name, others):
    limiter = guard("temperature", "current", "voltage")
    limiter.look(reading(*others))
    assert fault_after(limiter, *[reading(name, *others)] * SECOND) == [None] * SECOND
    limiter.look(reading(name, *others))
    assert str(limiter.fault) == f"{name}: no {name} measured for 1 s, expected one for {name}_limit"


@pytest.mark.parametrize("name", ["wrench", "temperature", "current", "voltage"])
def test_one_measurement_begins_the_second_anew(name):
    """A sensor that is slower than the cycle is no fault."""
    limiter = guard(*LIMITED)
    for _ in range(3):
        assert fault_after(limiter, reading(), *[reading(name)] * SECOND) == [None] * (SECOND + 1)
    assert fault_after(limiter, reading(name)) != [None]


@pytest.mark.parametrize("name", ["wrench", "temperature"])
def test_a_cleared_fault_comes_back_while_nothing_is_measured(name):
    limiter = guard("ft", "temperature")
    limiter.look(reading())
    fault_after(limiter, *[reading(name)] * (SECOND + 1))
    limiter.clear()
    assert fault_after(limiter, reading(name)) != [None]
    limiter.clear()
    assert fault_after(limiter, reading()) == [None]


def test_a_missing_torque_is_named_before_other_quantities():
    limiter = guard(*LIMITED)
    limiter.look(reading())
    causes = fault_after(limiter, *[reading("wrench", "temperature")] * (SECOND + 1))
    assert causes == [None] * SECOND + ["ft"]


@pytest.mark.parametrize("lacking", [("wrench",), ("wrench", "temperature", "current", "voltage")])
def test_without_its_limit_a_quantity_need_not_be_measured(lacking):
    limiter = guard()
    limiter.look(reading())
    assert fault_after(limiter, *[reading(*lacking)] * (SECOND + 50))[-1] is None


@pytest.mark.parametrize("name", ["temperature", "current", "voltage"])
def test_a_quantity_that_was_never_measured_trips_nothing(name):
    """`GuardedDevice.open` refuses its limit."""
    limiter = guard(name)
    assert fault_after(limiter, *[reading(name)] * (SECOND + 50))[-1] is None
