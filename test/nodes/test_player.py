"""What a player sends and when, without ROS: on the measurements' grid, softly to zero, nothing late."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.ros import ERROR, JointState, stamp_of
from rsea_ros.errors import DeviceError
from rsea_ros.nodes import _player
from rsea_ros.nodes._player import BenchEars, LiveRun, Player, check_followed
from rsea_ros.records.record import Channel, Fault, Record

MS = 1_000_000
NOW = 1_000_000 * MS
DISCOVERY = _player.DISCOVERY_TIME


class Node:
    """Of ROS, what a player needs: out are the stamps and torques that it published."""

    def __init__(self) -> None:
        self.out, self.heard, self.gone = [], {}, []

    def create_publisher(self, kind, topic, qos):
        assert topic == "torque_command"
        return SimpleNamespace(
            get_subscription_count=lambda: 1,
            publish=lambda m: self.out.append((stamp_of(m.header.stamp), m.effort[0], m.name[0])),
        )

    def create_subscription(self, kind, topic, take, qos):
        self.heard[topic] = take
        return topic

    def destroy_subscription(self, subscription):
        self.gone.append(subscription)


@pytest.fixture
def node(monkeypatch):
    monkeypatch.setattr(_player, "await_arrival", lambda publisher: None)
    monkeypatch.setattr(_player.time, "time_ns", lambda: NOW)
    return Node()


def player(node, command, *, lead=0.02, **options):
    made = Player(node, np.array(command, float), 100.0, lead=lead, wanted=1, joint="hip", **options)
    made.cycle = SimpleNamespace(
        start=lambda at: node.gone.append(at), stop=lambda: None, is_running=lambda: True, error=None
    )
    return made


def test_it_begins_a_whole_number_of_periods_after_a_measurement(node):
    made = player(node, [1.0])
    message = JointState()
    measured = NOW - 3 * MS
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(measured, 10**9)
    node.heard["joint_states"](message)
    begin, subscription = node.gone
    assert made.started and subscription == "joint_states"
    effect = begin + 20 * MS
    assert (effect - measured) % (10 * MS) == 0
    assert 0 <= effect - (NOW + 20 * MS + DISCOVERY) < 10 * MS
    node.heard["joint_states"](message)
    assert len(node.gone) == 2


@pytest.mark.parametrize("why", ["nobody listens", "not ready", "stopped"])
def test_it_does_not_begin(node, why):
    made = player(node, [1.0], ready=lambda: why != "not ready")
    if why == "nobody listens":
        made._wanted = 2
    if why == "stopped":
        made.stop()
    node.heard["joint_states"](JointState())
    assert not made.started and not node.gone
    assert made.over() == (why == "stopped")


def test_each_command_is_stamped_ahead_and_late_ones_are_left_out(node):
    made = player(node, [1.0, 2.0, 3.0])
    for late in (0, 10, 11):  # of 20 ms, 10 must be left
        made._step(NOW - late * MS)
    made._step(NOW)
    assert node.out == [(NOW + 20 * MS, 1.0, "hip"), (NOW + 10 * MS, 2.0, "hip"), (NOW + 20 * MS, 0.0, "hip")]
    assert (made.left_out, made.next) == (1, 4)
    short = player(node, [1.0], lead=0.004)  # half of 4 ms is enough
    short._step(NOW - 2 * MS)
    short._step(NOW - 3 * MS)
    assert short.left_out == 1
    at_once = player(node, [1.0, 2.0], lead=0.0)
    at_once._step(NOW - 500 * MS)
    assert at_once.left_out == 0


def test_a_stop_goes_to_zero_under_a_raised_cosine_within_a_tenth_of_a_second(node):
    made = player(node, [8.0] * 100)
    made.started = True
    assert not made.stopped and not made.over()
    for _ in range(5):
        made._step(NOW)
    made.stop()
    made.stop()
    while not made.over():
        made._step(NOW)
    torques = [torque for _, torque, _ in node.out]
    expected = [8.0] * 5 + [4.0 * (1.0 + math.cos(math.pi * k / 10.0)) for k in range(1, 11)]
    assert torques == pytest.approx(expected)
    made.stop()
    made._step(NOW)
    assert node.out[-1][1] == pytest.approx(0.0)
    almost = player(node, [8.0] * 6)
    almost.started, almost.next = True, 5
    almost.stop()
    assert not almost.over()
    almost._step(NOW)
    assert almost.over()


def test_three_zeros_follow_the_last_command(node):
    made = player(node, [1.0])
    made.started = True
    made._step(NOW)
    made.close()
    assert node.out[1:] == [(NOW + (20 + 10 * k) * MS, 0.0, "hip") for k in (1, 2, 3)]
    assert not node.gone
    idle = player(node, [1.0])
    idle.close()
    assert len(node.out) == 4 and node.gone == ["joint_states"]
    failed = player(node, [1.0] * 9)
    failed.started, failed.cycle.error = True, OSError()
    failed.close()
    assert failed.stopped and len(node.out) == 7


def status(name, level, message="too hot"):
    return SimpleNamespace(name=name, level=level, message=message)


def test_a_failure_raises_the_alarm_once_until_it_ends(node, monkeypatch):
    ears = SimpleNamespace(begin=lambda: None)
    monkeypatch.setattr(_player, "Ears", lambda *a: ears)
    bench, alarms = BenchEars(node, "torque.z"), []
    hear = node.heard["/diagnostics"]
    hear(SimpleNamespace(status=[status("driver", ERROR)]))
    bench.begin(alarms.append)
    for level in (ERROR, b"\x00", ERROR, ERROR):
        hear(SimpleNamespace(status=[status("driver", level), status("model", b"\x01")]))
    assert alarms == ["driver: too hot"]
    bench.last = 0.0
    bench._heard("torque_command")
    assert bench.last == 0.0
    bench._heard("ft")
    assert bench.last > 0.0


class Run:
    """A live run with a clock that tests set."""

    def __init__(self, monkeypatch, count=50):
        self.now, self.closed, self.stops = 100.0, [], 0
        monkeypatch.setattr(_player.time, "monotonic", lambda: self.now)
        self.ears = SimpleNamespace(
            begin=lambda alarm: setattr(self, "alarm", alarm), last=100.0,
            end=lambda: self.closed.append("ears"), record=lambda: self.made,
        )  # fmt: skip
        self.player = SimpleNamespace(
            command=np.zeros(count), rate=100.0, started=True, left_out=0, over=lambda: self.is_over,
            stop=lambda: setattr(self, "stops", self.stops + 1), close=lambda: self.closed.append("player"),
        )  # fmt: skip
        self.is_over, self.run = False, LiveRun(self.ears, self.player)


def test_a_run_is_over_once_enough_is_heard_for_a_diagnosis(monkeypatch):
    """Heard until half a second more than what a diagnosis needs, and for half a second in any case."""
    for count, rest in ((50, _player.SHORTEST + 0.5 - 0.5), (100_000, 0.5)):
        case = Run(monkeypatch, count)
        assert not case.run.over()
        case.is_over = True
        assert not case.run.over()
        case.now = case.ears.last = 100.0 + rest - 0.01
        assert not case.run.over()
        case.now = case.ears.last = 100.0 + rest + 0.01
        assert case.run.over() and not case.stops


def test_a_run_ends_at_silence_and_at_the_first_failure_of_its_bench(monkeypatch):
    case = Run(monkeypatch)
    case.now = 100.29
    assert not case.run.over() and not case.stops
    case.now = 100.31
    assert not case.run.over() and case.stops == 1
    case.is_over = True
    case.alarm("driver: too hot")
    assert case.run.over() and case.stops == 3
    with pytest.raises(DeviceError, match=r"no measurement for 0\.31 s"):
        case.run.record()
    case.run.close()
    assert case.closed == ["player", "ears"]
    waiting = Run(monkeypatch)
    waiting.player.started = False
    waiting.now = 107.0
    waiting.alarm("driver: too hot")
    assert waiting.run.waits() == 7.0 and not waiting.run.over() and not waiting.stops
    waiting.player.started = True
    assert waiting.run.waits() == 0.0


def record(*faults, torque=None):
    t, command = np.arange(200) / 100.0, np.full(200, 4.0)
    channels = {"command": Channel(t, command)}
    if torque is not None:
        channels["motor_torque"] = Channel(t + 0.01, torque(command))
    return Record(channels, faults=faults)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1.0, None), (0.46, None), (0.43, r"2\.28 N·m RMS off the command of 3\.99 N·m"), (0.0, "3.99 N·m RMS")],
)
def test_a_motor_that_does_not_follow_spoils_a_run(factor, words):
    check_followed(record())
    given = record(torque=lambda u: factor * u)
    if words is None:
        check_followed(given)
    else:
        with pytest.raises(DeviceError, match=words):
            check_followed(given)


@pytest.mark.parametrize("kind", ["commands_left_out", "late_commands", "lost_messages", "watchdog_trips"])
def test_a_run_whose_commands_did_not_act_as_planned_counts_for_nothing(monkeypatch, kind):
    case = Run(monkeypatch)
    case.made = record(Fault("outliers", "ft", 0.1, ""), torque=lambda u: u)
    assert case.run.record() is case.made
    case.made = record(Fault(kind, "command", 0.1, "9 of them"), torque=lambda u: u)
    with pytest.raises(DeviceError, match=f"{kind} 9 of them"):
        case.run.record()
    case.player.left_out = 3
    with pytest.raises(DeviceError, match="3 commands came too late"):
        case.run.record()
