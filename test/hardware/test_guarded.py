"""A device behind its limits: which calls reach it, in which order, and how its failures end."""

from __future__ import annotations

import math
from contextlib import ExitStack

import pytest

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import NoReply, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import DeviceFault, Limits
from rsea_ros.hardware.protection import BUS_WATCHDOG, NONE, Protection
from rsea_ros.hardware.spring import Spring

WRENCH = (0.0, 0.0, 0.0, 0.0, 0.0, 7.0)


class Log(Protection):
    """A protection that writes its beats to a log."""

    def __init__(self, kind, log):
        super().__init__(kind)
        self.log = log

    def beat(self, armed=None):
        self.log.append("beat" if armed is None else f"beat {armed}")


class Device:
    """A device that logs its calls. broken: by method, the errors of the next calls."""

    def __init__(self, kind=BUS_WATCHDOG):
        self.log, self.broken, self.during = [], {}, {}
        self.protection = Log(kind, self.log)
        self.reading = {}

    def _did(self, what):
        self.log.append(what)
        if self.broken.get(what.split()[0]):
            error = self.broken[what.split()[0]].pop(0)
            if error is not None:
                raise error
        self.during.get(what.split()[0], lambda: None)()

    def read(self):
        self._did("read")
        return State(1, **{"position": 0.0, "velocity": 0.0, "motor_torque": 0.0, **self.reading})

    def write(self, torque):
        self._did(f"write {torque:g}")

    def __getattr__(self, name):
        if name not in {"open", "enable", "disable", "zero_ft", "recover", "reboot", "close"}:
            raise AttributeError(name)
        return lambda: self._did(name)


@pytest.fixture
def device():
    return Device()


@pytest.fixture
def joint(device):
    """A guarded device, open and enabled, with nothing in its log; 4 N m a cycle of soft start."""
    made = GuardedDevice(device, Limits(64.0, slew=1e9, soft_start=256.0), 64.0)
    made.open()
    made.enable()
    device.log.clear()
    return made


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
    assert device.log == ["open"] and joint.fault is None


@pytest.mark.parametrize("kind", [NONE, BUS_WATCHDOG])
@pytest.mark.parametrize("unprotected", [False, True])
def test_a_device_that_nothing_protects_is_closed_again_unless_that_is_allowed(kind, unprotected):
    device = Device(kind)
    joint = GuardedDevice(device, Limits(64.0), 64.0)
    if kind == NONE and not unprotected:
        with pytest.raises(ParameterError, match="expected a bus watchdog or a supervisor"):
            joint.open(unprotected=unprotected)
        assert device.log == ["open", "close"]
    else:
        joint.open(unprotected=unprotected)
        assert device.log == ["open"]


def test_protection_is_required_by_default():
    with pytest.raises(ParameterError):
        GuardedDevice(Device(NONE), Limits(64.0), 64.0).open()


def test_a_cycle_writes_then_reads_and_beats_before_each(joint, device):
    state = joint.cycle(9.0, 0.0)
    assert device.log == ["beat True", "write 4", "beat", "read"]
    assert joint.state is state and state.stamp == 1
    assert joint.write(0.0, 0.0) == 0.0 and device.log[-2:] == ["beat False", "write 0"]


@pytest.mark.parametrize("value", [0.01, math.nan])
def test_a_deflection_is_measured_where_a_reading_has_one(joint, device, value):
    device.reading = {"deflection": value}
    assert joint.measures_deflection() is math.isfinite(value)
    device.broken = {"read": [NoReply("no reply")]}
    assert joint.measures_deflection() is False


def test_no_torque_gets_through_before_it_is_enabled(device):
    joint = GuardedDevice(device, Limits(64.0), 64.0)
    assert joint.write(9.0, 0.0) == 0.0
    assert device.log == ["beat False", "write 0"]


def test_a_reading_beyond_a_limit_ends_the_torque_in_the_same_cycle(joint, device):
    joint.cycle(9.0, 0.0)
    device.reading = {"temperature": 99.0}
    device.log.clear()
    joint.cycle(9.0, 0.0)
    assert joint.fault.cause == "temperature"
    assert device.log == ["beat True", "write 8", "beat", "read", "beat False", "write 0"]


LOST = NoReply("no reply")


@pytest.mark.parametrize(("method", "what"), [("read", "failed_reads"), ("write", "failed_writes")])
@pytest.mark.parametrize(
    ("answers", "fault"),
    [
        ([LOST, LOST, None, LOST, LOST], None),
        ([LOST, LOST, LOST], DeviceFault("no_reply", 3, 3, "cycles", "no reply")),
        ([DeviceError("access denied")], DeviceFault("deviceerror", detail="access denied")),
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
    device.broken = {method: [LOST, None] * 14}
    for _ in range(28):
        joint.cycle(1.0, 0.0)
    assert joint.fault is None
    device.broken = {method: [LOST]}
    joint.cycle(1.0, 0.0)
    assert joint.fault == DeviceFault("no_reply", 15, 15, "cycles", "of the last 29: no reply")
    joint.clear()
    device.broken = {method: [LOST] * 2}
    joint.cycle(1.0, 0.0)
    joint.cycle(1.0, 0.0)
    assert joint.fault is None and joint.cycles == {what: 17}


def test_a_write_that_is_acknowledged_during_the_reading_is_not_lost(joint, device):
    """At 1 kHz a driver whose readings all came latched no_reply: its writes were acknowledged too late."""
    device.broken, device.reading = {"write": [LOST] * 40}, {"acknowledged_late": True}
    for _ in range(40):
        joint.cycle(1.0, 0.0)
    assert joint.fault is None and joint.cycles == {"failed_writes": 40}
    device.broken, device.reading = {"write": [LOST] * 3}, {}
    for _ in range(3):
        joint.cycle(1.0, 0.0)
    assert joint.fault == DeviceFault("no_reply", 3, 3, "cycles", "no reply")


def test_a_third_of_the_answers_lost_is_none(joint, device):
    device.broken = {"read": [LOST, None, None] * 40}
    for _ in range(120):
        joint.cycle(1.0, 0.0)
    assert joint.fault is None


def test_an_answer_that_is_late_while_another_is_lost_makes_no_fault_of_both(joint, device):
    device.broken = {"read": [LOST, LOST], "write": [LOST, LOST]}
    joint.cycle(1.0, 0.0)
    joint.cycle(1.0, 0.0)
    assert joint.fault is None and joint.cycles == {"failed_reads": 2, "failed_writes": 2}


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
        assert joint.taken(first) is True
        with ExitStack() as second:
            assert joint.taken(second) is False
    with ExitStack() as third:
        assert joint.taken(third) is True, "it was let go"


def test_the_sensor_is_tared_only_without_torque_and_none_is_made_meanwhile(joint, device):
    written = []
    device.during = {"zero_ft": lambda: written.append(joint.write(9.0, 0.0))}
    joint.zero_ft()
    assert written == [0.0]
    assert joint.write(9.0, 0.0) == 4.0, "a soft start begins anew"
    with pytest.raises(DeviceError, match="zero_ft: 4 N m is commanded, expected 0 N m"):
        joint.zero_ft()
    assert device.log.count("zero_ft") == 1


def test_a_sensor_that_does_not_tare_does_not_keep_the_torque_off(joint, device):
    device.broken = {"zero_ft": [NoReply("no reply")]}
    with pytest.raises(NoReply):
        joint.zero_ft()
    assert joint.write(9.0, 0.0) == 4.0


def test_without_a_fault_there_is_nothing_to_clear(joint, device):
    assert joint.clear() is False
    assert device.log == []


def test_a_fault_is_cleared_by_a_reading_without_it(joint, device):
    joint.write(9.0, 0.0)
    joint.guard.trip(DeviceFault("ft"))
    device.log.clear()
    assert joint.clear() is True
    assert device.log == ["recover", "read", "enable"]
    assert joint.fault is None and joint.write(9.0, 0.0) == 4.0 and not joint.away


def test_a_fault_is_not_cleared_while_a_reading_has_it(joint, device):
    joint.guard.trip(DeviceFault("temperature"))
    device.reading = {"temperature": 99.0}
    with pytest.raises(DeviceError, match="temperature: 99 °C, limit 70 °C is still there"):
        joint.clear()
    assert joint.fault is not None and not joint.away and joint.enabled
    assert "enable" not in device.log and "disable" not in device.log


def test_lost_answers_are_counted_anew_after_a_fault_was_cleared(joint, device):
    for method in ("read", "write"):
        device.broken = {method: [LOST] * 3}
        for _ in range(3):
            joint.cycle(1.0, 0.0)
        assert joint.fault.cause == "no_reply"
        joint.clear()
        device.broken = {method: [LOST] * 2}
        for _ in range(2):
            joint.cycle(1.0, 0.0)
        assert joint.fault is None
        joint.cycle(1.0, 0.0)


def test_a_reboot_ends_the_torque_first_and_restores_it_afterwards(joint, device):
    joint.write(9.0, 0.0)
    device.log.clear()
    seen = []
    device.during = {"disable": lambda: seen.append((joint.guard.torque, joint.away))}
    joint.guard.trip(DeviceFault("ft"))
    joint.reboot()
    assert device.log == ["disable", "beat False", "reboot", "enable"]
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
    assert device.log == ["disable", "beat False", "reboot", *end]
    assert not joint.away and not joint.enabled


def test_a_failed_reboot_lets_go_of_the_device(joint, device):
    device.broken = {"reboot": [NoReply("no reply")]}
    joint.guard.trip(DeviceFault("ft"))
    with pytest.raises(NoReply):
        joint.reboot()
    assert not joint.away and joint.fault.cause == "ft"


SPRING = Spring(1500.0)


@pytest.mark.parametrize(
    ("spring", "reading", "source"),
    [
        (None, {}, "none"),
        (None, {"wrench": WRENCH}, "sensor"),
        (None, {"deflection": 0.01}, "none"),
        (SPRING, {}, "none"),
        (SPRING, {"wrench": WRENCH}, "sensor"),
        (SPRING, {"deflection": 0.01}, "stiffness of 1500 N m/rad times measured deflection"),
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


def test_a_device_disabled_during_a_reboot_stays_without_torque(joint, device):
    device.during = {"reboot": joint.disable}
    joint.reboot()
    assert device.log == ["disable", "beat False", "reboot", "disable", "beat False"]
    assert not joint.enabled and not joint.away
