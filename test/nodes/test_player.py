"""What excite and its player send and wait for, without ROS: on the grid, softly to zero, nothing late."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.ros import ERROR, OK, WARN, JointState, stamp_of
from rsea_ros.errors import DeviceError
from rsea_ros.nodes import _player
from rsea_ros.nodes._player import PATIENCE, BenchEars, BenchStatus, LiveRun, Player, check_followed
from rsea_ros.nodes.excite import ExciteNode, plan
from rsea_ros.records.record import Channel, Fault, Record

MS = 1_000_000
NOW = 1_000_000 * MS
DISCOVERY = _player.DISCOVERY_TIME


class Node:
    """Of ROS, what a player needs: out are the stamps and torques that it published."""

    def __init__(self):
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


def player(node, command, *, lead=0.02, ready=True, zero_first=lambda: False):
    class Bench:
        """Of a bench's status what a player asks."""

        zero_first = property(lambda self: zero_first())

        def ready(self):
            return ready

    made = Player(node, np.array(command, float), 100.0, Bench(), lead=lead, wanted=1, joint="hip")
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


def test_a_driver_that_wants_to_see_a_rest_hears_a_zero_and_then_nothing_for_a_second(node, monkeypatch):
    """`activate:=true excite:=true` ended in `restarted`: the run moved at once."""
    clock = [100.0]
    monkeypatch.setattr(_player.time, "monotonic", lambda: clock[0])
    made = player(node, [1.0], zero_first=lambda: clock[0] < 100.5)  # whose answer is one of a while ago
    for at, started in ((100.0, False), (100.7, False), (101.1, False), (101.3, True)):
        clock[0] = at
        node.heard["joint_states"](JointState())
        assert made.started is started
    assert node.out == [(NOW, 0.0, "hip")]


@pytest.mark.parametrize("why", ["nobody listens", "not ready", "stopped"])
def test_it_does_not_begin(node, why):
    made = player(node, [1.0], ready=why != "not ready")
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


def test_a_failure_raises_the_alarm_once_until_it_ends(node, monkeypatch):
    ears = SimpleNamespace(begin=lambda: None)
    monkeypatch.setattr(_player, "Ears", lambda *a: ears)
    bench, alarms = BenchEars(node, "torque.z"), []

    def hear(level):
        rows = ("driver", level, "too hot"), ("model", WARN, "")
        fields = "name", "level", "message"
        told = [SimpleNamespace(**dict(zip(fields, row, strict=True))) for row in rows]
        node.heard["/diagnostics"](SimpleNamespace(status=told))

    hear(ERROR)
    bench.begin(alarms.append)
    for level in (ERROR, OK, ERROR, ERROR):
        hear(level)
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
            rests=False, bench=SimpleNamespace(fault=""),
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
    waiting.player.rests = True
    assert waiting.run.waits() == 0.0
    waiting.player.bench.fault, waiting.is_over = "driver has latched a fault", True
    assert waiting.run.over() and waiting.stops == 1
    with pytest.raises(DeviceError, match="driver has latched a fault"):
        waiting.run.record()
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


@pytest.fixture
def bench(monkeypatch):
    """Return the status of a bench of two publishers, a clock, and what hears it."""
    now, heard, gone = [100.0], {}, []
    monkeypatch.setattr(_player.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(_player, "publishers_of", lambda node, topic: {"/rsea/driver", "/rsea/plant"})
    node = SimpleNamespace(
        create_subscription=lambda kind, topic, take, qos: heard.update({topic: take}) or topic,
        destroy_subscription=gone.append,
    )
    return BenchStatus(node, "hip", 8.0), now, heard, gone


def status(name="/rsea/driver", **values):
    pairs = [SimpleNamespace(key=k, value=str(v)) for k, v in values.items()]
    return SimpleNamespace(status=[SimpleNamespace(name=name, values=pairs)])


def test_commands_begin_once_the_bench_has_spoken_or_was_waited_for(bench):
    made, now, heard, gone = bench
    now[0] += 10.0
    assert not made.ready()
    heard["joint_states"](None)
    assert gone == ["joint_states"] and not made.ready()
    now[0] += PATIENCE - 0.01
    assert not made.ready()
    now[0] += 0.02
    assert made.ready()
    heard["/diagnostics"](status(active="False"))
    assert not made.ready() and made.idle == "/rsea/driver is not active; rsea call /rsea/driver activate"
    made.check(playing=False)
    with pytest.raises(DeviceError, match="is not active"):
        made.check(playing=True)
    heard["/diagnostics"](status(active="True"))
    assert made.ready()


@pytest.mark.parametrize(
    ("name", "values", "why"),
    [
        ("/rsea/driver", {"fault": "none"}, ""),
        ("/rsea/other", {"fault": "hot"}, None),
        ("/rsea/driver/knee", {"fault": "hot"}, None),
        ("/rsea/driver", {"fault": "hot"},
         "/rsea/driver has latched a fault, hot; rsea call /rsea/driver clear_fault"),
        ("/rsea/plant/hip", {"fault": "hot"},
         "/rsea/plant/hip has latched a fault, hot; rsea call /rsea/plant clear_fault"),
        ("/rsea/driver", {"torque_limit": 8.0}, ""),
        ("/rsea/driver", {"torque_limit": 7.5},
         "largest command 8 N·m, expected at most torque_limit = 7.5 N·m of /rsea/driver"),
    ],
)  # fmt: skip
def test_faults_and_limits_of_the_bench_end_a_run(bench, name, values, why):
    made, _, heard, _ = bench
    heard["/diagnostics"](status(name, **values))
    assert made.ready() == (why == "")
    if why:
        with pytest.raises(DeviceError) as error:
            made.check(playing=False)
        assert str(error.value) == why
        heard["/diagnostics"](status(name))
    made.check(playing=True)


def excite(**player):
    node, told = ExciteNode.__new__(ExciteNode), []
    timing = SimpleNamespace(values=lambda: {"late": 3})
    node._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(info=lambda text, **k: told.append(text)))
    node._player = SimpleNamespace(**{
        "started": True, "next": 30, "left_out": 0, "command": np.zeros(120), "rate": 60.0,
        "subscriptions": 1, "over": lambda: True, "close": lambda: told.append("closed"),
        "cycle": SimpleNamespace(timing=lambda: timing),
    } | player)  # fmt: skip
    node._bench = SimpleNamespace(idle="", check=lambda *, playing: told.append(playing))
    node._wanted = 2
    return node, told


def test_it_tells_how_far_it_is_and_what_it_waits_for():
    node, told = excite()
    assert node.is_finished() and told == [True]
    node._tell()
    node._player.next = 500
    node._tell()
    node.close()
    assert told[1:3] == ["25% of 2.0 s", "100% of 2.0 s"]
    assert told[3:] == ["closed", "torque zero after 500 commands, 0 left out"]
    assert node._report() == (OK, "running", {"commands": 500, "left_out": 0, "late": 3})
    node, told = excite(started=False, left_out=2)
    node._tell()
    node._bench.idle = "not active"
    node._tell()
    assert told == ["waiting: 1 of 2 subscriptions of torque_command and a message on joint_states",
                    "waiting: not active"]  # fmt: skip
    assert node._report() == (WARN, "waiting for a measurement", {"commands": 30, "left_out": 2})


def test_a_plan_is_a_file_or_what_the_parameters_say(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("t,command\n" + "".join(f"{k / 50.0},{k}\n" for k in range(20)))
    command, rate = plan({"file": str(file)})
    assert rate == pytest.approx(50.0) and command.tolist() == list(range(20))
    values = {"file": "", "kind": "steps", "rate": 100.0, "duration": 4.0, "amplitude": 5.0, "noise": 0.0,
              "low": 0.1, "high": 20.0, "period": 2.0, "seed": 1, "ramp": 0.0}  # fmt: skip
    command, rate = plan(values)
    assert rate == 100.0 and len(command) == 400 and np.max(np.abs(command)) == pytest.approx(5.0)
