"""Several motors and an encoder on one bus: one sync write and read a cycle; a fault spares the others."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from types import SimpleNamespace

import pytest

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import NoReply, Spring
from rsea_ros.hardware.dynamixel.control_tables import TABLES, MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.encoder import LINK, BusEncoder, EncoderConnection
from rsea_ros.hardware.dynamixel.line import Line, LineMotor
from rsea_ros.hardware.guarded import GuardedDevice, cycle
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.motor_netft import MotorNetft
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.peer.peer_motor import IDENTITY
from rsea_ros.hardware.peer.registers import ENCODER
from rsea_ros.hardware.protection import Supervised
from rsea_ros.nodes import driver
from rsea_ros.nodes._devices import dynamixel_netft
from test.hardware.conftest import FT_TIMEOUT, LATENCY, PERIOD, STIFFNESS, WATCHDOG
from test.nodes.stalls import until
from test.nodes.warm import Bench

MODELS = (1020, 1120, 1170)
SMALL = Limits(3.0, deflection=math.inf, lost_cycles=3)


class Three:
    """Three motors of the X series, enabled, each with its own limits."""

    def __init__(self, bench, fast):
        self.bench = bench
        self.line = Line(bench.port, 4_000_000, LATENCY, fast=fast)
        sensor = SensorConnection("127.0.0.1", bench.ft_port, bench.page_port, FT_TIMEOUT)
        self.members = [
            GuardedDevice(_device(bench, self.line, k + 1, None if k else sensor), SMALL, 1.0 / PERIOD)
            for k in range(3)
        ]
        for member in self.members:
            for _ in range(3):
                with suppress(NoReply):  # of a bench that stands still
                    member.open()
                    break
            else:
                member.open()
            member.enable()

    def cycles(self, count, torques):
        """Several; returns the newest reading of each: a busy machine loses one now and then."""
        newest = [None] * len(self.members)
        for _ in range(count):
            time.sleep(PERIOD)
            states = cycle(self.members, [(torque, 0.0) for torque in torques], [self.line])
            newest = [state or old for state, old in zip(states, newest, strict=True)]
        return newest

    def beside(self, work):
        """Run work in a thread while the cycles go on; return their readings. Raises its error."""
        heard = []
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                heard.append(self.cycles(1, (1.0, 1.0, 1.0)))
        future.result()
        return heard

    def causes(self):
        """Return the latched fault of each motor."""
        return [member.fault and member.fault.cause for member in self.members]

    def acting(self):
        """Return whether each motor has a goal and its torque on."""
        goals = [self.bench.torque(place) for place in range(3)]
        return [goal != 0 and on for goal, on in goals]


def _device(bench, line, identity, sensor=None, felt=None):
    settings = MotorConnection(bench.port, 4_000_000, identity, latency=LATENCY, watchdog=WATCHDOG)
    motor = LineMotor(settings, line)
    encoder = BusEncoder(felt, motor.port) if felt else None
    return MotorNetft(motor, sensor, SMALL, math.inf, encoder=encoder)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Three motors on one line, and an encoder on the spring of the first."""
    with Bench(tmp_path_factory.mktemp("line") / "tty", "--model", *MODELS, "--deflection") as made:
        yield made


BOTH = pytest.mark.parametrize("three", [False, True], ids=["sync", "fast sync"], indirect=True)


@pytest.fixture
def three(bench, request):
    bench.ask("misbehave", drop=0.0)
    for place in range(3):
        bench.ask("set", motor=place, temperature=32, voltage=120, hardware_error=0)
    made = Three(bench, getattr(request, "param", True))
    yield made
    for member in made.members:
        member.device.close()
    assert [bench.torque(place) for place in range(3)] == [(0, False)] * 3


@BOTH
def test_each_motor_makes_its_torque_by_two_frames_a_cycle(three):
    states = three.cycles(40, (0.5, -1.0, 2.0))
    assert [state.motor_torque for state in states] == pytest.approx([0.5, -1.0, 2.0], abs=0.25)
    assert [member.fault for member in three.members] == [None] * 3
    heard, begun = [all(three.cycles(1, (0.5, -1.0, 2.0)))], time.monotonic_ns()
    heard += [all(three.cycles(1, (0.5, -1.0, 2.0))) for _ in range(10)]
    samples = [reply for reply in three.bench.log(begun)["replies"] if reply[1] == 126]
    replies = [1 if before and three.line._fast else 3 for before in heard[:-1]]  # a late one, and all reply
    assert len(samples) == sum(replies)
    assert three.bench.torque(2) == (round(2.0 / 1.939 / 2.69e-3), True)


def test_the_sensor_of_the_first_motor_is_read_in_the_same_cycle(three):
    """With all of its records since the reading before: at 400 Hz one or two in a cycle."""
    three.cycles(20, (2.0, 0.0, 0.0))

    def several():
        states = three.cycles(1, (2.0, 0.0, 0.0))
        return states if states[0] and len(states[0].wrenches) > 1 else None

    state, *others = until(several)
    assert math.isfinite(state.wrench[5])
    assert [other.wrench for other in others] == [None, None]


def test_a_fault_of_one_zeroes_it_alone_and_is_cleared_alone(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    three.bench.ask("set", motor=1, temperature=90)
    three.cycles(2, (1.0, 1.0, 1.0))
    assert three.causes() == [None, "temperature", None]
    assert three.acting() == [True, False, True]
    three.bench.ask("set", motor=1, temperature=32)
    heard = three.beside(three.members[1].clear)
    three.cycles(5, (1.0, 1.0, 1.0))
    assert three.causes() == [None] * 3 and three.acting() == [True] * 3
    assert all(states[0] is not None and states[2] is not None for states in heard)


def test_a_reboot_of_one_leaves_the_others_their_torque(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    shares = []
    for _ in range(5):  # others may burn the cores in one of the two
        heard = three.beside(three.members[0].reboot)
        shares.append(len(heard) / len(three.beside(lambda: time.sleep(0.3))))
        if shares[-1] > 0.45:
            break
    assert shares[-1] > 0.45, f"{shares}: in its 0.3 s, a line that waits for it has a cycle or two"
    assert sum(states[1] is None or states[2] is None for states in heard) <= 2
    assert three.causes() == [None] * 3
    three.cycles(5, (1.0, 1.0, 1.0))
    assert three.acting() == [True] * 3


@BOTH
def test_an_unplugged_motor_does_not_silence_the_others(three):
    """Motors behind it in a request wait for its reply, so it is asked last in the next one."""
    three.cycles(5, (1.0, 1.0, 1.0))
    three.bench.ask("set", motor=0, id=9)
    try:
        for _ in range(5):  # until the machine does not stand still for three cycles
            three.cycles(8, (1.0, 1.0, 1.0))
            if three.causes()[1:] == [None, None]:
                break
            for member in three.members[1:]:
                with suppress(DeviceError):
                    member.clear()
        assert three.causes() == ["no_reply", None, None]
        assert three.acting()[1:] == [True, True]
        with pytest.raises(DeviceError, match="no reply to ping"):
            three.beside(three.members[0].clear)
        assert three.causes() == ["no_reply", None, None]
    finally:
        three.bench.ask("set", motor=0, id=1)
    three.beside(three.members[0].clear)
    three.cycles(8, (1.0, 1.0, 1.0))
    assert three.causes() == [None] * 3 and three.acting() == [True] * 3


def test_a_clear_of_a_motor_that_is_away_lets_no_supervisor_go(monkeypatch):
    """It wrote its frames and read the answers of the others, on the port of all, for seconds: no_reply."""
    motor = LineMotor(MotorConnection("/dev/null"), Line("/dev/null", 4_000_000, LATENCY))
    motor.table, motor.protection, released = TABLES[54024], Supervised(WATCHDOG), []

    def lose(*given):
        raise NoReply("away")

    monkeypatch.setattr(motor.protection, "release", lambda *, safe: released.append(safe))
    monkeypatch.setattr(motor.bus, "patiently", lose)
    with pytest.raises(NoReply):
        motor.recover()
    assert released == [] and motor.table is not None


def test_the_death_of_the_host_is_each_motors_own_watchdog(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    until(lambda: not any(three.bench.torque(place)[0] for place in range(3)))
    assert [str(member.device.protection) for member in three.members] == ["bus watchdog, 0.5 s"] * 3


def test_motors_of_two_series_are_refused_on_one_line(tmp_path):
    with Bench(tmp_path / "tty", "--model", 1020, 2120) as bench:
        line = Line(bench.port, 4_000_000, LATENCY)
        first, second = _device(bench, line, 1), _device(bench, line, 2)
        first.open()
        with pytest.raises(DeviceError, match="XM430-W350, PM54-060-S250-R, expected motors of one series"):
            second.open()
        assert first.read().position == pytest.approx(0.0, abs=0.01)
        first.close()


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
    return SimpleNamespace(position=position, velocity=velocity, stamp=instant)


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


def test_a_configure_without_the_encoder_is_refused(bench):
    device = _device(bench, Line(bench.port, 4_000_000, LATENCY), 1, felt=EncoderConnection(77, latency=1e-3))
    with pytest.raises(NoReply, match="encoder ID 77"):
        device.open()
    assert bench.torque() == (0, False)


def test_an_encoder_is_read_beside_several_motors_of_a_line(bench):
    line = Line(bench.port, 4_000_000, LATENCY)
    felt = EncoderConnection(IDENTITY, pulses=ENCODER.counts_per_turn, latency=LATENCY)
    devices = _device(bench, line, 1, felt=felt), _device(bench, line, 2)
    members = [GuardedDevice(device, SMALL, 1.0 / PERIOD, Spring(STIFFNESS)) for device in devices]
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
    for device in devices:
        device.close()
