"""A second encoder on the motor's bus in place of an F/T sensor: its deflection, its zero, its loss."""

import math
from types import SimpleNamespace

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import NoReply, Spring
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.encoder import LINK, BusEncoder, EncoderConnection
from rsea_ros.hardware.dynamixel.line import Line, LineMotor
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.guarded import GuardedDevice, cycle
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.motor_netft import MotorNetft
from rsea_ros.hardware.peer.peer_motor import IDENTITY
from rsea_ros.hardware.peer.registers import ENCODER
from rsea_ros.nodes import driver
from rsea_ros.nodes._devices import dynamixel_netft
from test.hardware.conftest import LATENCY, PERIOD, STIFFNESS, WATCHDOG
from test.nodes.warm import Bench

TURN = 2.0 * math.pi
DEFAULTS = {parameter.name: parameter.default for parameter in driver.TABLE}


class Answers:
    """A bus that gives the counts of a list, and keeps the sizes that were read."""

    def __init__(self, *counts):
        self.counts, self.sizes, self.latency = list(counts), [], 0.0

    def read(self, address, size):
        self.sizes.append((address, size))
        if (count := self.counts.pop(0)) is None:
            raise NoReply("no reply")
        return count.to_bytes(4, "little", signed=True).ljust(size, b"\7")

    def patiently(self, transaction):
        return transaction()


def encoder(*counts, **settings):
    made = BusEncoder(EncoderConnection(100, **settings), SimpleNamespace(latency=0.0, return_delay=0.0))
    made._bus = Answers(*counts)
    return made


def sample(position=0.0, velocity=0.0, instant=0):
    return SimpleNamespace(position=position, velocity=velocity, instant=instant)


def test_it_counts_from_where_it_is_opened_unless_its_own_zero_counts():
    for absolute, zero in ((False, 1000), (True, 0)):
        made = encoder(1000, 1100, -300, pulses=4096.0)
        made.open(sample(), absolute=absolute)
        read = [made.deflection(sample()) for _ in range(2)]
        assert read == pytest.approx([TURN * (counts - zero) / 4096.0 for counts in (1100, -300)])


def test_negative_pulses_reverse_it():
    made = encoder(0, 1024, pulses=-4096.0)
    made.open(sample(), absolute=False)
    assert made.deflection(sample()) == pytest.approx(-TURN / 4.0)


def test_an_encoder_of_the_link_is_compared_with_the_output_at_its_own_instant(monkeypatch):
    made = encoder(0, 100, pulses=4096.0, place=LINK)
    made.open(sample(position=0.5), absolute=True)
    monkeypatch.setattr("time.monotonic_ns", lambda: 3_000_000)
    read = made.deflection(sample(position=0.5, velocity=2.0, instant=1_000_000))
    assert read == pytest.approx(0.5 + 2.0 * 0.002 - TURN * 100 / 4096.0)


def test_the_next_read_after_a_lost_reply_has_another_size():
    """A reply that comes late would be taken for the new one."""
    made = encoder(0, None, 5, None, 5)
    made.open(sample(), absolute=False)
    for _ in range(2):
        with pytest.raises(NoReply):
            made.deflection(sample())
        assert made.deflection(sample()) == pytest.approx(TURN * 5 / 4096.0)
    assert made._bus.sizes == [(132, 4), (132, 4), (132, 5), (132, 5), (132, 4)]


def test_a_cycle_that_loses_three_replies_still_ends_in_time():
    assert 3.0 * usual_latency(280.0, 3) < 1.0 / 280.0 and usual_latency(280.0, 3) < usual_latency(280.0)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"encoder_id": 1}, "encoder_id = 1, expected another than that of the motor"),
        ({"encoder_id": 5, "encoder_pulses": 0.0}, "encoder_pulses = 0, expected counts of a turn"),
    ],
)
def test_impossible_settings_are_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        dynamixel_netft(DEFAULTS | {"ft_host": ""} | values)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    with Bench(tmp_path_factory.mktemp("encoder") / "tty", "--deflection") as made:
        yield made


def test_a_configure_without_the_encoder_is_refused(bench):
    motor = Motor(MotorConnection(bench.port, 4_000_000, latency=LATENCY))
    encoder = BusEncoder(EncoderConnection(77, latency=1e-3), motor.port)
    device = MotorNetft(motor, None, Limits(68.0), STIFFNESS, encoder=encoder)
    with pytest.raises(NoReply, match="encoder ID 77"):
        device.open()
    assert bench.torque() == (0, False)


def test_it_is_read_beside_several_motors_of_a_line(tmp_path):
    with Bench(tmp_path / "tty", "--model", 1020, 1120, "--deflection") as bench:
        line = Line(bench.port, 4_000_000, LATENCY)
        small = Limits(3.0, deflection=math.inf)
        settings = EncoderConnection(IDENTITY, pulses=ENCODER.counts_per_turn, latency=LATENCY)
        members = []
        for identity, felt in ((1, settings), (2, None)):
            given = MotorConnection(bench.port, 4_000_000, identity, latency=LATENCY, watchdog=WATCHDOG)
            motor = LineMotor(given, line)
            encoder = BusEncoder(felt, motor.port) if felt else None
            device = MotorNetft(motor, None, small, math.inf, encoder=encoder)
            members.append(GuardedDevice(device, small, 1.0 / PERIOD, Spring(STIFFNESS)))
        for member in members:
            member.open()
            member.enable()
        states = [None, None]
        for _ in range(100):  # a busy machine loses a reading now and then
            newest = cycle(members, [(2.0, 0.0), (1.0, 0.0)], [line])
            states = [new or old for new, old in zip(newest, states, strict=True)]
        assert [member.fault for member in members] == [None, None]
        assert states[0].deflection == pytest.approx(states[0].position, abs=2e-3)
        assert math.isnan(states[1].deflection) and states[1].wrench is None
        for member in members:
            member.device.close()
