"""Several motors on one bus: one sync write and one sync read a cycle; a fault of one spares the others."""

import math
import time

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.dynamixel.line import Line
from rsea_ros.hardware.dynamixel.member import Member, cycle
from rsea_ros.hardware.dynamixel.settings import Settings
from rsea_ros.hardware.guarded import Guarded
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.peer.remote import RemoteBench
from test.hardware.conftest import LATENCY, PERIOD, WATCHDOG

MODELS = (1020, 1120, 1170)
SMALL = Limits(3.0, deflection=math.inf, lost_cycles=3)


class Three:
    """Three motors of the X series, enabled, each with its own limits."""

    def __init__(self, bench, fast):
        self.bench = bench
        usual = {"latency": LATENCY, "watchdog": WATCHDOG}
        settings = [Settings(bench.port, 4_000_000, k + 1, **usual) for k in range(3)]
        self.line = Line(settings, fast=fast)
        self.line.open()
        self.members = [Guarded(Member(self.line, k + 1), SMALL, 1.0 / PERIOD) for k in range(3)]
        for member in self.members:
            member.open()
            member.enable()

    def cycles(self, count, torques):
        """Several; returns the readings of the last."""
        for _ in range(count):
            time.sleep(PERIOD)
            states = cycle(self.line, self.members, [(torque, 0.0) for torque in torques])
        return states


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Three motors on one line."""
    with RemoteBench(tmp_path_factory.mktemp("line") / "tty", "--model", *MODELS) as made:
        yield made


@pytest.fixture(params=[False, True], ids=["sync", "fast sync"])
def three(bench, request):
    bench.ask("misbehave", drop=0.0)
    for place in range(3):
        bench.ask("set", motor=place, temperature=32, voltage=120, hardware_error=0)
    made = Three(bench, request.param)
    yield made
    made.line.close()
    assert [bench.torque(place) for place in range(3)] == [(0, False)] * 3


def test_each_motor_makes_its_torque_by_two_frames_a_cycle(three):
    states = three.cycles(40, (0.5, -1.0, 2.0))
    assert [state.motor_torque for state in states] == pytest.approx([0.5, -1.0, 2.0], abs=0.25)
    assert [member.fault for member in three.members] == [None] * 3
    begun = time.monotonic_ns()
    three.cycles(10, (0.5, -1.0, 2.0))
    log = three.bench.log(begun)
    samples = [reply for reply in log["replies"] if reply[1] == 126]
    assert len(samples) == (10 if three.line._fast else 30)
    assert three.bench.torque(2) == (round(2.0 / 1.939 / 2.69e-3), True)


def test_a_fault_of_one_zeroes_it_alone_and_is_cleared_alone(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    three.bench.ask("set", motor=1, temperature=90)
    three.cycles(2, (1.0, 1.0, 1.0))
    assert [member.fault and member.fault.cause for member in three.members] == [None, "temperature", None]
    goals = [three.bench.torque(place)[0] for place in range(3)]
    assert goals[1] == 0 and goals[0] != 0 and goals[2] != 0
    three.bench.ask("set", motor=1, temperature=32)
    three.members[1].clear()
    three.cycles(5, (1.0, 1.0, 1.0))
    assert three.members[1].fault is None and three.bench.torque(1)[0] != 0


def test_a_line_that_is_not_heard_zeroes_every_motor(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    three.bench.ask("misbehave", drop=1.0)
    three.cycles(4, (1.0, 1.0, 1.0))
    assert {member.fault.cause for member in three.members} == {"no_reply"}
    assert [three.bench.torque(place)[0] for place in range(3)] == [0] * 3
    three.bench.ask("misbehave", drop=0.0)
    for member in three.members:
        member.clear()
    three.cycles(5, (1.0, 1.0, 1.0))
    assert [member.fault for member in three.members] == [None] * 3


def test_the_death_of_the_host_is_each_motors_own_watchdog(three):
    three.cycles(5, (1.0, 1.0, 1.0))
    deadline = time.monotonic() + 20.0
    while any(three.bench.torque(place)[0] for place in range(3)):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert [str(member.device.protection) for member in three.members] == ["bus watchdog, 0.5 s"] * 3


def test_motors_of_two_series_are_refused_on_one_line(tmp_path):
    with RemoteBench(tmp_path / "tty", "--model", 1020, 2120) as bench:
        line = Line([Settings(bench.port, 4_000_000, k, latency=LATENCY) for k in (1, 2)])
        with pytest.raises(DeviceError, match="XM430-W350, PM54-060-S250-R, expected motors of one series"):
            line.open()
    with pytest.raises(DeviceError, match="an ID twice"):
        Line([Settings("/nowhere"), Settings("/nowhere")])
