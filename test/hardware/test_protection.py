"""Protection against a dead host: of every device, asked when it is opened; devices from outside."""

import math
from pathlib import Path

import pytest

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import Spring
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.outside import options_of, outside_device
from rsea_ros.hardware.protection import NONE

TOY = Path(__file__).with_name("toy_device.py")


@pytest.fixture
def toy(monkeypatch):
    """A function that makes a toy with options, by the environment variable."""
    monkeypatch.setenv("RSEA_DEVICES", str(TOY))
    made = []

    def make(watchdog=0.1, **options):
        kind = outside_device("toy", ("simulated",))
        assert kind.feels
        made.append(kind.make({"device_options": options, "watchdog": watchdog}))
        return made[-1]

    yield make
    for device in made:
        device.close()


def guard(device, spring=None, **limits):
    return GuardedDevice(device, Limits(68.0, **limits), 280.0, spring)


def test_a_device_without_protection_is_refused_unless_that_is_allowed(toy):
    device = toy()
    with pytest.raises(ParameterError, match="allow_no_dead_host_protection = true"):
        guard(device).open()
    assert not device.opened, "nothing stays open"
    guard(device).open(unprotected=True)
    assert device.opened


def test_a_supervised_toy_is_stopped_when_the_driver_hangs(toy):
    """It held its torque after a kill -9: the supervisor was private to the Dynamixel code."""
    device = toy(supervised="yes")
    loop = guard(device)
    loop.open()
    assert str(device.protection) == "supervisor, 0.1 s"
    loop.enable()
    for _ in range(5):
        loop.cycle(10.0, 0.0)
    device.far.settimeout(10.0)
    assert device.far.recv(5) == b"stop\n"  # nobody has beaten for a while
    loop.cycle(10.0, 0.0)
    assert loop.fault.cause == "heldup" and device.torque == 0.0
    device.close()
    assert device.protection.kind == NONE


def test_a_long_reboot_under_torque_is_not_taken_for_a_hang(toy):
    """Only the motor told the supervisor that its torque was off: one that was being set up was stopped."""
    device = toy(supervised="yes", boot="0.3")
    loop = guard(device)
    loop.open()
    loop.enable()
    for _ in range(3):
        loop.cycle(10.0, 0.0)
    loop.reboot()
    loop.cycle(10.0, 0.0)
    device.far.setblocking(False)
    with pytest.raises(BlockingIOError):
        device.far.recv(5)
    assert loop.fault is None


def test_the_springs_deflection_is_a_wrench_where_no_sensor_measures_one(toy):
    device = toy()
    loop = guard(device, Spring(1500.0, place=5, sign=-1.0), deflection=0.05, ft=60.0)
    loop.open(unprotected=True)
    loop.enable()
    states = [loop.cycle(10.0, 0.0) for _ in range(3)]
    assert states[-1].wrench == pytest.approx((0, 0, 0, 0, 0, -1500.0 * 0.01))
    assert states[-1].inferred and states[-1].ft_stamp == states[-1].stamp
    assert loop.ft_source == "stiffness of 1500 N·m/rad times measured deflection"
    assert loop.fault is None, "the drive stands at 3 rad: what counts is the spring's deflection"
    loop.cycle(66.0, 0.0)
    assert loop.fault.cause in ("deflection", "ft_torque")


def test_a_deflection_that_is_not_measured_stays_a_fault_until_it_is_again(toy):
    """The second reading without it was none: clear_fault was granted, and no limit held the spring."""
    device = toy()
    loop = guard(device, Spring(1500.0), deflection=math.inf, ft=60.0)
    loop.open(unprotected=True)
    loop.enable()
    loop.cycle(0.0, None)
    device.deflection_known = False
    for _ in range(3):
        loop.cycle(10.0, 0.0)
    with pytest.raises(DeviceError, match="deflection is not measured any more is still there"):
        loop.clear()
    assert loop.fault is not None and device.torque == 0.0
    device.deflection_known = True
    assert loop.clear() and loop.cycle(10.0, 0.0).inferred and loop.fault is None


WRONG = {
    "no such device": ("", "parameter device = 'toys', expected one of simulated, toy"),
    "no DEVICE": ("DEVICE = 3", r"RSEA_DEVICES: .*mine\.py: no DEVICE in it"),
    "broken": ("1 / 0", r"RSEA_DEVICES: .*mine\.py: ZeroDivisionError"),
    "the package's name": (
        "from rsea_ros.hardware.outside import DeviceKind\nDEVICE = DeviceKind('simulated', print)",
        "device 'simulated' twice, expected once",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_does_not_fit_is_refused(monkeypatch, tmp_path, name):
    code, told = WRONG[name]
    (tmp_path / "mine.py").write_text(code or TOY.read_text())
    monkeypatch.setenv("RSEA_DEVICES", str(tmp_path))
    with pytest.raises(ParameterError, match=told):
        outside_device("toys", ("simulated",))


def test_options_are_texts_by_name():
    assert options_of("a=1, b = x y") == {"a": "1", "b": "x y"} and options_of("") == {}
    with pytest.raises(ParameterError, match="expected NAME=VALUE"):
        options_of("a")
