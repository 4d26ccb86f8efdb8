"""Limits against plain arithmetic: which torques are cut, which readings trip, and how the torque ends."""

import math
from pathlib import Path

import pytest
import yaml

from rsea_ros.hardware.device import State
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Guard, Limits

PERIOD = 0.01
ROOT = Path(__file__).resolve().parents[2]


def guard(**limits):
    return Guard(Limits(68.0, **limits), PERIOD)


def test_torque_is_cut_at_its_limit_either_way_and_counted():
    limited = guard(slew=1e6)
    assert [limited.allowed_torque(w, 0.0) for w in (500.0, -500.0, 20.0)] == [68.0, -68.0, 20.0]
    assert limited.limited == 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_commands_that_cease_end_in_a_ramp_and_a_fault(sign):
    late = guard(slew=1e6, command_timeout=0.05, ramp=0.04)
    assert late.allowed_torque(sign * 40.0, 0.05) == sign * 40.0
    assert [late.allowed_torque(sign * 40.0, 0.06) for _ in range(5)] == [
        sign * t for t in (30, 20, 10, 0, 0)
    ]
    assert str(late.fault) == "command_timeout: 60 ms, limit 50 ms"
    assert late.allowed_torque(sign * 40.0, 0.0) == 0.0, "it is latched"
    late.clear()
    assert late.allowed_torque(sign * 40.0, 0.0) == sign * 40.0


def test_the_first_command_does_not_act_in_full_after_start_fault_and_pause():
    soft = guard(slew=1e6, soft_start=300.0)
    begin = [3.0, 6.0, 9.0, 10.0]
    assert [soft.allowed_torque(10.0, 0.0) for _ in range(4)] == begin
    soft.trip(DeviceFault("any"))
    assert soft.allowed_torque(10.0, 0.0) == 0.0
    soft.clear()
    assert [soft.allowed_torque(10.0, 0.0) for _ in range(4)] == begin
    soft.allowed_torque(0.0, 0.0)
    soft.allowed_torque(0.0, 9.0)
    assert [soft.allowed_torque(10.0, 0.0) for _ in range(4)] == begin


def test_the_default_slew_limit_is_that_of_the_driver():
    """A Limits of one's own allowed four times the slew of the driver."""
    driver = yaml.safe_load((ROOT / "config" / "nodes" / "driver.yaml").read_text(encoding="utf-8"))
    (parameters,) = (node["ros__parameters"] for node in driver.values())
    assert Limits(1.0).slew == parameters["slew_limit"]


@pytest.mark.parametrize(("wanted", "age"), [(math.nan, 0.0), (math.inf, 0.0), (-1e6, 0.0), (10.0, math.nan)])
def test_a_command_that_is_none_leads_to_zero_within_the_slew_limit(wanted, age):
    """NaN was returned, and dropped the slew limit; -1e6 N m was obeyed as -68; an age of NaN was none."""
    limited = guard(slew=300.0)
    for _ in range(5):
        limited.allowed_torque(10.0, 0.0)
    assert [limited.allowed_torque(wanted, age) for _ in range(4)] == [7.0, 4.0, 1.0, 0.0]
    assert limited.refused == (4 if age == 0.0 else 0) and limited.allowed_torque(10.0, 0.0) == 3.0


@pytest.mark.parametrize("nothing", [None, (0.0, 0.0, 0.0, 0.0, 0.0, math.nan), (0.0,) * 5 + (math.inf,)])
def test_a_wrench_without_the_torque_is_none_for_its_limit(nothing):
    """None was a fault after a second; NaN switched the limit off in silence."""
    blind = guard(ft=50.0)
    for _ in range(102):
        blind.look(State(0, 0.0, 0.0, 0.0, wrench=nothing))
    assert str(blind.fault) == "ft: no torque measured for 1 s, expected one for ft_limit"


@pytest.mark.parametrize("nothing", [math.nan, math.inf])
def test_a_deflection_that_ceases_is_a_fault_and_not_the_drives_angle(nothing):
    felt = guard()
    felt.look(State(0, 9.0, 0.0, 0.0, deflection=0.01))
    for k in range(101):
        assert felt.fault is None, k
        felt.look(State(0, 9.0, 0.0, 0.0, deflection=nothing))
    assert "no deflection measured for 1 s" in str(felt.fault)
