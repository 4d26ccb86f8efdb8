"""A device behind its limits: enable, disable, tare, clear a fault, reboot; one thread at a time uses it."""

from contextlib import ExitStack

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Limits
from test.hardware.logged_device import LOST, cycles


def test_enabling_needs_no_fault_and_begins_softly(joint, device):
    joint.write(9.0, 0.0)
    joint.enable()
    assert joint.write(9.0, 0.0) == 4.0 and device.log.count("enable") == 1
    joint.guard.trip(DeviceFault("ft", detail="saturation"))
    with pytest.raises(DeviceError, match="fault ft: saturation, expected clear_fault first"):
        joint.enable()
    assert device.log.count("enable") == 1


def test_a_device_that_does_not_enable_gets_no_torque(device):
    joint = GuardedDevice(device, Limits(64.0), 64.0)
    device.broken = {"enable": [NoReply("no reply")]}
    with pytest.raises(NoReply):
        joint.enable()
    assert not joint.enabled


def test_disabling_makes_the_torque_zero_and_informs_the_protection(joint, device):
    joint.write(9.0, 0.0)
    device.log.clear()
    joint.disable()
    assert device.log == ["disable", "beat False"]
    assert (joint.enabled, joint.guard.torque) == (False, 0.0)


def test_a_device_that_another_thread_uses_is_left_alone(joint, device):
    joint.away = True
    assert joint.cycle(9.0, 0.0) is None
    for refused in (joint.enable, joint.reboot):
        with pytest.raises(DeviceError, match=r"^clear_fault or reboot is under way"):
            refused()
    joint.guard.torque = 4.0
    joint.disable()
    assert device.log == [] and joint.guard.torque == 0.0 and not joint.enabled
    assert joint.away, "it is still the other's"


def test_a_cycle_does_not_wait_for_another_user_of_the_device(joint):
    with ExitStack() as first:
        assert joint.take(first) is True
        with ExitStack() as second:
            assert joint.take(second) is False
    with ExitStack() as third:
        assert joint.take(third) is True, "it was let go"


def test_the_sensor_is_tared_only_without_torque_and_none_is_made_meanwhile(joint, device):
    written = []

    def meanwhile():
        with pytest.raises(DeviceError, match="zero_ft: another one is under way"):
            joint.zero_ft()  # the end of which let the torque through, under which the first one tared
        written.append(joint.write(9.0, 0.0))

    device.during = {"zero_ft": meanwhile}
    joint.zero_ft()
    assert written == [0.0]
    assert joint.write(9.0, 0.0) == 4.0, "a soft start begins anew"
    with pytest.raises(DeviceError, match="zero_ft: 4 N·m is commanded, expected 0 N·m"):
        joint.zero_ft()
    assert device.log.count("zero_ft") == 1


def test_a_sensor_that_does_not_tare_does_not_keep_the_torque_off(joint, device):
    device.broken = {"zero_ft": [NoReply("no reply")]}
    with pytest.raises(NoReply):
        joint.zero_ft()
    assert joint.write(9.0, 0.0) == 4.0


def test_a_fault_is_cleared_by_a_reading_without_it(joint, device):
    assert joint.clear() is False and device.log == [], "without a fault there is nothing to clear"
    joint.write(9.0, 0.0)
    joint.guard.trip(DeviceFault("ft"))
    joint.write(9.0, 0.0)
    device.log.clear()
    assert joint.clear() is True
    assert device.log == ["recover", "read", "enable"]
    assert joint.fault is None and joint.write(9.0, 0.0) == 4.0 and not joint.away


@pytest.mark.parametrize("refusal", [None, NoReply("no reply")])
def test_a_torque_that_is_being_ramped_down_ends_before_a_fault_is_cleared(joint, device, refusal):
    """No cycle ran while the sensor was waited for: the motor held what the ramp had left for seconds."""
    joint.write(9.0, 0.0)
    joint.guard.trip(DeviceFault("command_timeout"))
    device.log.clear()
    device.broken, seen = {"disable": [refusal]}, []
    device.during = {"recover": lambda: seen.append(joint.guard.torque)}
    assert joint.clear() is True and seen == [0.0]
    assert [each for each in device.log if "beat" not in each] == ["disable", "recover", "read", "enable"]
    assert "beat False" in device.log or refusal


def test_a_fault_is_not_cleared_while_a_reading_has_it(joint, device):
    joint.guard.trip(DeviceFault("temperature"))
    device.reading = {"temperature": 99.0}
    with pytest.raises(DeviceError, match="temperature: 99 °C, limit 70 °C is still there"):
        joint.clear()
    assert joint.fault is not None and not joint.away and joint.enabled
    assert "enable" not in device.log and "disable" not in device.log


@pytest.mark.parametrize("method", ["read", "write"])
@pytest.mark.parametrize("anew", ["clear", "open"])
def test_lost_answers_are_counted_anew_after_a_fault_was_cleared_and_in_another_life(
    joint, device, method, anew
):
    cycles(joint, device, 3, **{method: [LOST] * 3})
    assert joint.fault.cause == "no_reply"
    getattr(joint, anew)()
    cycles(joint, device, 2, **{method: [LOST] * 2})
    assert joint.fault is None


def test_a_reboot_ends_the_torque_first_and_restores_it_afterwards(joint, device):
    joint.write(9.0, 0.0)
    device.log.clear()
    seen = []
    device.during = {"disable": lambda: seen.append((joint.guard.torque, joint.away))}
    joint.guard.trip(DeviceFault("ft"))
    joint.reboot()
    assert device.log == ["disable", "beat False", "reboot", "read", "enable"]
    assert seen == [(0.0, True)]
    assert joint.fault is None and joint.enabled and not joint.away
    assert joint.write(9.0, 0.0) == 4.0


@pytest.mark.parametrize("refusal", [None, NoReply("no reply")])
def test_a_disabled_device_stays_disabled_over_a_reboot(joint, device, refusal):
    joint.disable()
    device.log.clear()
    device.broken = {"disable": [None, refusal]}
    joint.reboot()
    end = ["disable", "beat False"] if refusal is None else ["disable"]
    assert device.log == ["disable", "beat False", "reboot", "read", *end]
    assert not joint.away and not joint.enabled


def test_a_failed_reboot_lets_go_of_the_device(joint, device):
    device.broken = {"reboot": [NoReply("no reply")]}
    joint.guard.trip(DeviceFault("ft"))
    with pytest.raises(NoReply):
        joint.reboot()
    assert not joint.away and joint.fault.cause == "ft"


@pytest.mark.parametrize("latched", ["", "ft"])
@pytest.mark.parametrize("broken", ["disable", "reboot", "read", "enable"])
def test_a_failed_reboot_leaves_a_fault_and_a_motor_that_is_off(joint, device, broken, latched):
    """It was active without a fault, with a motor that was off, or on at 5 N m where the answer was lost."""
    joint.write(9.0, 0.0)
    if latched:
        joint.guard.trip(DeviceFault(latched))
    device.broken = {broken: [LOST] * 30}
    with pytest.raises(NoReply):
        joint.reboot()
    assert str(joint.fault).rstrip() == (f"{latched}:" if latched else "reboot: failed: no reply")
    assert not joint.is_off and joint.enabled
    device.log.clear()
    for answer in (LOST, LOST, None):
        device.broken = {"disable": [answer]}
        joint.cycle(9.0, 0.0)
        assert joint.is_off is (answer is None) and joint.guard.torque == 0.0
    joint.cycle(9.0, 0.0)
    assert device.log.count("disable") == 3
    assert joint.clear() is True and joint.write(9.0, 0.0) == 4.0 and not joint.is_off
    joint.cycle(9.0, 0.0)
    assert device.log.count("disable") == 3


def test_a_clear_whose_enable_is_not_answered_switches_the_motor_off(joint, device):
    joint.guard.trip(DeviceFault("ft"))
    device.broken = {"enable": [LOST]}
    with pytest.raises(NoReply):
        joint.clear()
    joint.cycle(9.0, 0.0)
    assert joint.fault.cause == "ft" and device.log[-2:] == ["disable", "beat False"] and joint.is_off


@pytest.mark.parametrize("anew", [False, True])
def test_a_motor_that_did_not_answer_a_deactivation_is_switched_off_when_it_does(joint, device, anew):
    """It stayed on at zero, and was said to be off."""
    device.broken = {"disable": [LOST]}
    with pytest.raises(NoReply):
        joint.disable()
    assert not joint.is_off and not joint.enabled
    if anew:
        joint.enable()
    device.log.clear()
    joint.cycle(9.0, 0.0)
    assert ("disable" in device.log) is joint.is_off is not anew


def test_a_device_disabled_during_a_reboot_stays_without_torque(joint, device):
    device.during = {"reboot": joint.disable}
    joint.reboot()
    assert device.log == ["disable", "beat False", "reboot", "read", "disable", "beat False"]
    assert not joint.enabled and not joint.away


@pytest.mark.parametrize("latched", [True, False])
def test_a_reboot_after_which_a_reading_has_a_fault_leaves_it(joint, device, latched):
    """It was forgotten, also at 90 °C, and the next command made a torque."""
    if latched:
        joint.guard.trip(DeviceFault("temperature"))
    device.reading = {"temperature": 90.0}
    with pytest.raises(DeviceError, match="temperature: 90 °C, limit 70 °C is still there"):
        joint.reboot()
    assert joint.fault.cause == "temperature" and "enable" not in device.log
    assert joint.write(9.0, 0.0) == 0.0 and not joint.away
    device.reading = {}
    assert joint.clear() is True and joint.write(9.0, 0.0) == 4.0
