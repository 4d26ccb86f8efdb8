"""A simulated bench in a process of its own, and the driver's loop without ROS in this one."""

import math
import time
from contextlib import contextmanager, suppress

import pytest

from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.motor_netft import CONFIGURE, MotorNetft
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.peer.registers import MODELS

PERIOD = 1.0 / 280.0
STIFFNESS = 1530.456
LATENCY, FT_TIMEOUT, WATCHDOG = 0.03, 0.2, 0.5
"""s; a machine that is busy with other tests must not look like a fault."""


def device_on(bench, limits=None, *, zero=CONFIGURE, **motor):
    """Return the driver's device on a bench; a model that is a name is a drive on a CAN bus."""
    patient, model = {"latency": LATENCY, "watchdog": WATCHDOG, **motor}, getattr(bench, "model", 54024)
    if isinstance(model, str):
        made = MitMotor(CanConnection(bench.port, model, interface="slcan", **patient))
    else:
        made = Motor(MotorConnection(bench.port, 4_000_000, **patient))
    sensor = SensorConnection("127.0.0.1", bench.ft_port, bench.page_port, FT_TIMEOUT)
    return MotorNetft(made, sensor, limits or limits_on(bench), STIFFNESS, zero=zero)


def limits_on(bench):
    """Return limits of a motor; no drive on CAN of the test makes 68 N m, nor knows each its temperature."""
    if not isinstance(model := getattr(bench, "model", 54024), str):
        return Limits(68.0)
    return Limits(11.0, temperature=math.inf if model == "mini-cheetah" else 70.0)


class Loop:
    """The driver's loop, run by the test: each cycle commands `torque`."""

    def __init__(self, bench, limits=None, **motor):
        self.bench = bench
        self.device = device_on(bench, limits, **motor)
        self.guarded = GuardedDevice(self.device, limits or limits_on(bench), 1.0 / PERIOD)
        for _ in range(3):
            with suppress(NoReply):  # of a bench that stands still
                self.guarded.open()
                break
        else:
            self.guarded.open()
        self.states = []

    def cycle(self, torque, age=0.0):
        """One cycle at about its pace; returns what was written."""
        time.sleep(PERIOD)
        state = self.guarded.cycle(torque, age)
        if state is not None:
            self.states.append(state)
        return self.guarded.guard.torque

    def cycles(self, count, torque, age=0.0):
        """Several; returns what was written in each."""
        return [self.cycle(torque, age) for _ in range(count)]

    def acts(self, torque):
        """Whether three cycles in a row write the torque; what a stalled machine has latched is cleared."""
        from test.nodes.stalls import is_stall  # not where test_lost_torque runs a Loop without pytest

        for _ in range(5):
            if self.cycles(3, torque) == [torque] * 3:
                return True
            if self.guarded.fault is None or not is_stall(self.guarded.fault.cause):
                return False
            self.guarded.clear()
        return False

    def until_fault(self, torque, most=400):
        """Run until a fault is latched; returns how many cycles that took."""
        for count in range(1, most + 1):
            self.cycle(torque)
            if self.guarded.fault is not None:
                return count
        raise AssertionError(f"no fault in {most} cycles")

    def close(self):
        """End it."""
        self.device.close()


@pytest.fixture(scope="module")
def benches(tmp_path_factory):
    """A function that gives the running bench of a model, made on first use."""
    from test.nodes.warm import Bench  # not where test_lost_torque runs a Loop of its own, without pytest

    made = {}

    def bench(model=54024):
        if model not in made:
            path = tmp_path_factory.mktemp("bench") / f"tty{model}"
            made[model] = Bench(path, "--can" if isinstance(model, str) else "--model", model)
            made[model].model = model
            known = not isinstance(model, str)
            made[model].volts = MODELS[model].registers["voltage"].start if known else 240
        return made[model]

    yield bench
    for each in made.values():
        each.close()


@pytest.fixture
def device():
    """A device that logs its calls."""
    from test.hardware.logged_device import Device  # not where test_lost_torque runs a Loop without pytest

    return Device()


@pytest.fixture
def joint(device):
    """It behind its limits, open and enabled."""
    from test.hardware.logged_device import guard

    return guard(device)


@contextmanager
def driven(bench):
    """Yield an enabled loop on a bench that behaves well, which commands 10 N m."""
    well_behaved(bench)
    running = Loop(bench)
    running.guarded.enable()
    running.cycles(2, 10.0)
    assert running.acts(10.0), running.guarded.fault
    yield running
    well_behaved(bench)
    running.close()


@pytest.fixture
def loop(benches, request):
    """Such a loop on the bench of the model that the test asks for."""
    with driven(benches(getattr(request, "param", 54024))) as running:
        yield running


def well_behaved(bench):
    """Undo every misbehaviour."""
    bench.ask("appear")
    calm = dict.fromkeys(("drop", "delay", "corrupt", "truncate", "wrong_crc", "ft_drop"), 0.0)
    bench.ask("misbehave", unstuffed=False, silent=False, ft_silent=False, ft_stuck=False, **calm)
    bench.ask("set", hardware_error=0, voltage=bench.volts, temperature=32)
    bench.ask("ft_status", bits=0)
