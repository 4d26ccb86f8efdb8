"""A device behind its limits: the calls of each cycle in their order, and the end of its failures."""

import math
from contextlib import nullcontext

import pytest

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import Refused, Spring
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.protection import BUS_WATCHDOG, NONE, PROCESS
from test.hardware.logged_device import LOST, Device, cycles

WRENCH = (0.0, 0.0, 0.0, 0.0, 0.0, 7.0)


def test_nothing_is_enabled_counted_or_read_before_it_is_asked_for(device):
    new = GuardedDevice(device, Limits(64.0), 64.0)
    assert (new.enabled, new.away, new.state, new.fault, new.cycles) == (False, False, None, None, {})
    assert device.log == []


def test_the_rate_is_that_of_the_cycles(device):
    joint = GuardedDevice(device, Limits(64.0, slew=128.0), 64.0)
    joint.enable()
    assert joint.write(9.0, 0.0) == 2.0


def test_opening_begins_softly_and_without_a_fault(device):
    joint = GuardedDevice(device, Limits(64.0), 64.0)
    joint.guard.trip(DeviceFault("ft"))
    joint.open()
    assert device.log == ["open", "read"] and joint.fault is None


def test_a_lowered_limit_acts_in_the_next_cycle_and_none_is_raised_under_torque(device):
    stated = {"torque": 60.0, "slew": 64.0, "voltage": 20.0}
    joint = GuardedDevice(device, Limits(1.0), 64.0, None, lambda rating: Limits(**stated, derived={}))
    device.reading["voltage"] = 24.0
    joint.open()
    joint.enable()
    while joint.write(10.0, 0.0) < 10.0:
        pass
    stated["torque"] = 3.0
    joint.limit(["torque"])
    assert joint.write(10.0, 0.0) == 3.0, "the slew limit, 1 N m a cycle, would take 7 cycles"
    stated["torque"] = 4.0
    with pytest.raises(ParameterError, match="torque is raised while active, expected deactivate first"):
        joint.limit(["torque"])
    stated["voltage"] = 19.0
    with pytest.raises(ParameterError, match="voltage = 19, expected at least 20"):
        joint.limit(["voltage"])
    joint.disable()
    joint.limit(["torque"])
    assert joint.guard.limits.torque == 4.0 and joint.guard.limits.voltage == 20.0
    stated["torque"] = 61.0
    with pytest.raises(ParameterError, match="torque = 61, expected at most 60"):
        joint.limit(["torque"])


@pytest.mark.parametrize(
    ("kind", "how", "refused"),
    [
        (BUS_WATCHDOG, {}, False),
        (BUS_WATCHDOG, {"unprotected": True}, False),
        (NONE, {"unprotected": True}, False),
        (NONE, {"unprotected": False}, True),
        (NONE, {}, True),
    ],
)
def test_a_device_that_nothing_protects_is_closed_again_unless_that_is_allowed(kind, how, refused):
    device = Device(kind)
    with pytest.raises(ParameterError, match="expected a bus watchdog") if refused else nullcontext():
        GuardedDevice(device, Limits(64.0), 64.0).open(**how)
    assert device.log == ["open", "close" if refused else "read"]


@pytest.mark.parametrize("name", ["temperature", "current", "voltage"])
def test_a_limit_of_what_is_not_measured_is_refused(device, name):
    """It was dropped, and nobody was told."""
    every = {"temperature": 30.0, "current": 1.0, "voltage": 24.0}
    limits = Limits(64.0, temperature=70.0, current=12.0, voltage=20.0)
    device.reading = every | {name: math.nan}
    with pytest.raises(ParameterError, match=f"{name}_limit = .* measures no {name}, expected 0 for none"):
        GuardedDevice(device, limits, 64.0).open()
    assert device.log == ["open", "read", "close"]
    GuardedDevice(device, limits.without([name]), 64.0).open()
    device.reading = every
    joint = GuardedDevice(device, limits, 64.0)
    joint.open()
    assert joint.lifted == [] and joint.guard.limits == limits


def test_a_simulation_says_which_limits_do_not_apply_to_it():
    device = Device(PROCESS)
    joint = GuardedDevice(device, Limits(64.0, voltage=20.0, current=12.0), 64.0)
    joint.open()
    assert joint.lifted == ["current", "voltage"] and joint.guard.limits == Limits(64.0)
    device.reading |= {"voltage": 24.0, "current": 1.0}
    joint.open()
    assert joint.lifted == [], "the limits that were lifted for it are back"
    assert joint.cycle(1.0, 0.0) and joint.fault is None
    assert joint.cycle(1.0, 0.0) and joint.guard.limits.temperature == 70.0
    device.reading |= {"voltage": 19.0}
    assert joint.cycle(1.0, 0.0) and joint.fault.cause == "voltage"


@pytest.mark.parametrize(
    ("lost", "log"), [(2, ["open", "read", "read", "read"]), (30, ["open", *["read"] * 30, "close"])]
)
def test_a_device_may_lose_some_answers_before_it_is_not_opened(device, lost, log):
    device.broken = {"read": [LOST] * lost}
    with pytest.raises(DeviceError) if lost == 30 else nullcontext():
        GuardedDevice(device, Limits(64.0), 64.0).open()
    assert device.log == log


def test_a_cycle_writes_then_reads_and_beats_before_each(joint, device):
    state = joint.cycle(9.0, 0.0)
    assert device.log == ["beat True", "write 4", "beat", "read"]
    assert joint.state is state and state.stamp == 1
    assert joint.write(0.0, 0.0) == 0.0 and device.log[-2:] == ["write 0", "beat False"]


@pytest.mark.parametrize("value", [0.01, math.nan])
def test_a_deflection_is_measured_where_a_reading_has_one(joint, device, value):
    device.reading = {"deflection": value}
    assert joint.measures_deflection() is math.isfinite(value)
    device.broken = {"read": [LOST]}
    assert joint.measures_deflection() is math.isfinite(value), "one lost reply took the topic away"
    device.broken = {"read": [LOST] * 30}
    assert joint.measures_deflection() is False
    device.broken = {"read": [DeviceError("not open")]}
    assert joint.measures_deflection() is False


def test_no_torque_gets_through_before_it_is_enabled(device):
    joint = GuardedDevice(device, Limits(64.0), 64.0)
    assert joint.write(9.0, 0.0) == 0.0
    assert device.log == ["write 0", "beat False"]


def test_a_reading_beyond_a_limit_ends_the_torque_in_the_same_cycle(joint, device):
    joint.cycle(9.0, 0.0)
    device.reading = {"temperature": 99.0}
    device.log.clear()
    joint.cycle(9.0, 0.0)
    assert joint.fault.cause == "temperature"
    assert device.log == ["beat True", "write 8", "beat", "read", "write 0", "beat False"]


@pytest.mark.parametrize(("method", "what"), [("read", "failed_reads"), ("write", "failed_writes")])
@pytest.mark.parametrize(
    ("answers", "fault"),
    [
        ([LOST, LOST, None, LOST, LOST], None),
        ([LOST, LOST, LOST], DeviceFault("no_reply", 3, 3, "cycles", "no reply")),
        ([DeviceError("access denied")], DeviceFault("deviceerror", detail="access denied")),
        ([Refused("access denied")], DeviceFault("refused", detail="access denied")),
    ],
)
def test_lost_answers_in_a_row_are_a_fault_and_other_errors_at_once(
    joint, device, method, what, answers, fault
):
    device.broken = {method: [*answers]}
    states = [joint.cycle(1.0, 0.0) for _ in answers]
    assert joint.cycles == {what: sum(a is not None for a in answers)}
    assert repr(joint.fault) == repr(fault)  # nan equals nan there
    if method == "read":
        assert [s is None for s in states] == [a is not None for a in answers]


@pytest.mark.parametrize(("method", "what"), [("read", "failed_reads"), ("write", "failed_writes")])
def test_every_second_answer_lost_is_a_fault_though_never_two_in_a_row(joint, device, method, what):
    """Torque went on for ever on a line that lost every second reply."""
    cycles(joint, device, 28, **{method: [LOST, None] * 14})
    assert joint.fault is None
    cycles(joint, device, 1, **{method: [LOST]})
    assert joint.fault == DeviceFault("no_reply", 15, 15, "cycles", "of the last 29: no reply")
    joint.clear()
    cycles(joint, device, 2, **{method: [LOST] * 2})
    assert joint.fault is None and joint.cycles == {what: 17}


def test_a_write_that_is_acknowledged_during_the_reading_is_not_lost(joint, device):
    """At 1 kHz a driver whose readings all came latched no_reply: its writes were acknowledged too late."""
    device.reading = {"acknowledged_late": True}
    cycles(joint, device, 40, write=[LOST] * 40)
    assert joint.fault is None and joint.cycles == {"failed_writes": 40}
    device.reading = {}
    cycles(joint, device, 3, write=[LOST] * 3)
    assert joint.fault == DeviceFault("no_reply", 3, 3, "cycles", "no reply")


@pytest.mark.parametrize(
    ("count", "broken"),
    [(120, {"read": [LOST, None, None] * 40}), (2, {"read": [LOST] * 2, "write": [LOST] * 2})],
    ids=["a third of them", "late ones while others are lost"],
)
def test_answers_lost_now_and_then_are_no_fault(joint, device, count, broken):
    cycles(joint, device, count, **broken)
    assert joint.fault is None
    assert joint.cycles == {f"failed_{method}s": errors.count(LOST) for method, errors in broken.items()}


SPRING = Spring(1500.0)


@pytest.mark.parametrize(
    ("spring", "reading", "source"),
    [
        (None, {}, "none"),
        (None, {"wrench": WRENCH}, "sensor"),
        (None, {"deflection": 0.01}, "none"),
        (SPRING, {}, "none"),
        (SPRING, {"wrench": WRENCH}, "sensor"),
        (SPRING, {"deflection": 0.01}, "stiffness of 1500 N·m/rad times measured deflection"),
        (SPRING, {"wrench": WRENCH, "deflection": 0.01}, "sensor"),
    ],
)
def test_a_wrench_comes_from_sensor_or_deflection(device, spring, reading, source):
    joint = GuardedDevice(device, Limits(64.0), 64.0, spring)
    assert joint.ft_source == "none"
    device.reading = reading
    joint.read()
    assert joint.ft_source == source


@pytest.mark.parametrize(
    ("before", "now", "fault"),
    [
        ({"deflection": 0.01}, {"deflection": 0.01}, None),
        ({"deflection": 0.01}, {}, "ft: the spring's deflection is not measured any more"),
        ({}, {}, None),
        ({}, {"deflection": 0.01}, None),
        ({"wrench": WRENCH}, {}, None),
    ],
)
def test_a_deflection_that_was_measured_must_go_on(device, before, now, fault):
    joint = GuardedDevice(device, Limits(64.0), 64.0, SPRING)
    device.reading = before
    joint.read()
    device.reading = now
    joint.read()
    assert (None if joint.fault is None else str(joint.fault)) == fault


@pytest.mark.parametrize("before", [{}, {"deflection": 0.01}])
def test_opening_forgets_where_the_wrench_came_from(device, before):
    """A device that was opened again with its F/T sensor would be a fault from its first reading."""
    joint = GuardedDevice(device, Limits(64.0, temperature=math.inf), 64.0, SPRING)
    device.reading = before
    joint.read()
    device.reading = {"wrench": WRENCH}
    joint.open()
    assert joint.read().wrench == WRENCH and joint.fault is None
