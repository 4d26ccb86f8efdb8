"""A position that jumps is a fault; one that turns as fast as it may is none, however coarse its encoder."""

import math
import random
from dataclasses import replace

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.dynamixel.control_tables import TABLES, MotorConnection, TorqueConstant
from rsea_ros.hardware.dynamixel.motor import Motor, OwnLimits
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.limits import Limits, Rating
from rsea_ros.hardware.mit_can.frames import _families
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig
from test.hardware.logged_device import Device

DRIVES = [name for content in _families().values() for name in content["models"]]
SECOND, JITTER = 1_000_000_000, 0.4
"""ns; share of a cycle by which a reading is early or late of its stamp."""


def rating_of(model):
    """What a motor of that model says of itself."""
    if isinstance(model, str):
        return MitMotor(CanConnection("vcan0", model)).rating
    motor = Motor(MotorConnection("/dev/null"))
    motor.table, motor.torque_constant = TABLES[model], TorqueConstant(1.0, 1.0, 1.0, "")
    motor.limits = OwnLimits(0, 0, 0, 5.0, 80.0, 10.0, 30.0, 0.0, False)
    return motor.rating


class Turning(Device):
    """A device whose encoder counts."""

    def __init__(self, rating):
        super().__init__()
        self.rating = rating
        self.turn(0.0, 0.0, 0.0)

    def turn(self, at, angle, velocity):
        """Stand at an angle (rad) at an instant (s)."""
        whole = math.floor(angle / self.rating.count) * self.rating.count
        self.state = State(round(at * SECOND), whole, velocity, 0.0, temperature=30.0)

    def read(self):
        return self.state


@pytest.mark.parametrize("rate", [280.0, 1000.0])
@pytest.mark.parametrize("model", [*TABLES, *DRIVES])
def test_a_rotor_at_its_velocity_limit_is_no_fault_and_a_jump_beyond_it_is(model, rate):
    """A count of an X (1.5 mrad) was more than twice what 0.2 rad/s allow at 280 Hz: a fault at the first."""
    rating, dice = rating_of(model), random.Random(1)
    count = 2.0 * math.pi / TABLES[model].pulses if model in TABLES else rating.count
    assert rating.count == pytest.approx(count) and 0.0 < count < 4e-3
    for velocity in (0.0, 1e-3, 0.2, 2.356, min(rating.velocity, 5.0)):
        device = Turning(rating)
        joint = GuardedDevice(device, Limits(64.0, deflection=math.inf, velocity=velocity), rate)
        joint.open()
        for k in range(100):
            late, noise = dice.uniform(-JITTER, JITTER) / rate, dice.uniform(0.0, count)
            device.turn(k / rate, velocity * (k / rate + late) + noise, velocity)
            joint.read()
        assert joint.fault is None, (velocity, f"{joint.fault}")
        device.turn(100 / rate, joint.state.position + 2.0 * velocity / rate + 4.0 * count, velocity)
        joint.read()
        assert joint.fault.cause == "position_step", velocity


@pytest.mark.parametrize("meanwhile", [False, True])
def test_a_jump_is_cleared_once_the_position_is_where_it_was_and_not_before(meanwhile):
    """It was cleared where it was: the limit of a free end had moved with it.

    meanwhile: whether it jumps while a service has the device.
    """
    device = Turning(Rating(count=1e-3))
    joint = GuardedDevice(device, Limits(64.0, deflection=math.inf, velocity=2.0, position=1.5), 280.0)
    joint.open()
    joint.read()
    device.turn(1 / 280.0, 1.0, 0.0)
    if meanwhile:
        joint.guard.trip(DeviceFault("ft"))
        with pytest.raises(DeviceError, match=r"position_step: 1 rad.* is still there"):
            joint.clear()
    for k in range(2, 500):
        device.turn(k / 280.0, 1.0 + 1e-3 * (k % 2), 0.0)
        joint.read()
    with pytest.raises(DeviceError, match="position jumped by 1 rad, expected cleanup and configure"):
        joint.clear()
    for k in range(500, 700):  # back, again and again, but for what a spring relaxed meanwhile
        device.turn(k / 280.0, 1.0 * (k % 2) + 0.025, 0.0)
        joint.read()
    device.turn(700 / 280.0, 0.025, 0.0)
    joint.read()
    assert joint.clear() and joint.fault is None
    device.turn(701 / 280.0, 1.0, 0.0)
    joint.read()
    with pytest.raises(DeviceError, match=r"position jumped by 0\.975 rad"):
        joint.clear()
    joint.open()
    joint.read()
    assert joint.fault is None


@pytest.mark.parametrize("sensors", [{"position": Sensor(1e-3)}, {"position": Sensor(2e-3, 5e-3)}, {}])
def test_a_coarse_or_noisy_encoder_of_a_simulated_rig_is_no_fault_at_rest(sensors):
    rig, clock = replace(load_rig("paper_high_impedance"), sensors=sensors), [0]
    device = SimulatedDevice(rig, 280.0, clock=lambda: clock[0])
    joint = GuardedDevice(device, Limits(64.0, velocity=0.1), 280.0)
    joint.open()
    for _ in range(1000):
        clock[0] += round(SECOND / 280.0)
        joint.cycle(0.0, None)
    assert joint.fault is None
