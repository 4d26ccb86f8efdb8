"""When a page may command, on which stamps, within which limits; how a silent node is shown."""

import math
from types import SimpleNamespace

import pytest

from rsea_extras.watch import node as module
from rsea_extras.watch.command import Bounds
from rsea_extras.watch.node import ANSWER, LOOK, WatchCommand, _put, _status_json

MS = 1_000_000
NOW = 10_000 * MS


@pytest.fixture
def made(monkeypatch):
    """Return a command, the publishers by topic, and what was published."""
    there = {"joint_states": {"/rsea/driver"}, "torque_command": {"/rsea/watch"}}
    out = []
    monkeypatch.setattr(module.ros, "publishers_of", lambda node, topic: there[topic])
    monkeypatch.setattr(module.ros, "await_arrival", lambda publisher: out.append("arrived"))
    monkeypatch.setattr(module.time, "time_ns", lambda: NOW)
    node = SimpleNamespace(
        create_publisher=lambda *a: SimpleNamespace(publish=out.append),
        get_fully_qualified_name=lambda: "/rsea/watch",
    )
    values = {"rate": 100.0, "limit": 10.0, "growth": 20.0, "joint": "hip"}
    command = WatchCommand(node, SimpleNamespace(newest=0), values)
    command._writer = SimpleNamespace(write=lambda stamp, values: (stamp, *values))
    command._bench = "/rsea/driver"
    return command, there, out


def answer(*values):
    return SimpleNamespace(result=lambda: SimpleNamespace(values=[
        SimpleNamespace(type=0 if v is None else 3, double_value=v or 0.0) for v in values
    ]))  # fmt: skip


@pytest.mark.parametrize(
    ("told", "bounds"),
    [
        ((5.0, 300.0, 8.0), Bounds(5.0, 300.0, 8.0)),
        ((0.5, 0.5, 0.5), Bounds(0.5, 0.5, 0.5)),
        ((0.0, 300.0, 0.0), Bounds(0.0, 300.0, 0.0)),
        ((-1.0, -1.0, -1.0), Bounds(10.0, math.inf, 20.0)),
        ((None, None, None), Bounds(10.0, math.inf, 20.0)),
        ((50.0, 1.0, 90.0), Bounds(10.0, 1.0, 20.0)),
        ((5.0,), Bounds(5.0, math.inf, 20.0)),
        ((), Bounds(10.0, math.inf, 20.0)),
    ],
)
def test_the_limits_of_a_page_are_the_lesser_of_its_own_and_the_drivers(made, told, bounds):
    command, _, _ = made
    command._on_limits("/rsea/other", answer(1.0, 1.0, 1.0))
    assert command.commander.bounds is None
    command._on_limits("/rsea/driver", answer(*told))
    assert command.commander.bounds == bounds


def test_a_page_may_not_command_beside_others_or_without_a_bench(made):
    command, there, _ = made
    assert command.why_not == "nothing is known of the bench yet"
    assert command._reason() == "/rsea/driver has not said its limits yet"
    command._on_limits("/rsea/driver", answer())
    assert command._reason() == ""
    there["torque_command"] |= {"/rsea/excite", "/rsea/controller"}
    assert command._reason() == "/rsea/controller, /rsea/excite commands already"
    there["torque_command"] = set()
    command._bench = ""
    assert command._reason() == "nobody publishes joint_states"
    command._bench = "/a, /b"
    assert command._reason() == "/a, /b publish joint_states, expected one"


def test_a_command_is_published_ahead_and_left_out_where_too_little_is_left(made):
    command, _, out = made
    now = [NOW]
    anchor = SimpleNamespace(offset=NOW - 2000 * MS, now=lambda: now[0])
    command._cycle = SimpleNamespace(anchor=anchor)
    asked = []
    command.commander = SimpleNamespace(torque=lambda t: asked.append(t) or 1.5)
    command._step(NOW)
    assert out == [(NOW + 20 * MS, 1.5)] and asked == [2.0]
    now[0] = NOW + 14 * MS
    command._step(NOW)
    assert len(out) == 2
    now[0] = NOW + 15 * MS
    command._step(NOW)
    assert len(out) == 2
    now[0], command.commander = NOW, SimpleNamespace(torque=lambda t: None)
    command._step(NOW)
    assert len(out) == 2


def test_the_end_releases_whoever_holds_and_waits_for_zeros(made):
    command, _, out = made
    ended = []
    command.commander = SimpleNamespace(holder="page", active=False, release=ended.append)
    command._cycle = SimpleNamespace(stop=lambda: ended.append("stopped"))
    command.close()
    assert ended == ["page", "stopped"] and out == ["arrived"]
    command.commander.holder, command._cycle = None, None
    command.close()
    assert ended == ["page", "stopped"]


def test_a_node_that_falls_silent_is_shown_stale_with_what_it_said():
    said = {"name": "driver", "level": 0, "message": "fine"}
    assert _status_json(module.SILENT - 0.01, said) is said
    stale = _status_json(module.SILENT + 2.4, said)
    assert stale["level"] == module.STALE and stale["name"] == "driver"
    assert stale["message"] == f"silent for {module.SILENT + 2.4:.0f} s; before: fine"
    rows: dict = {}
    _put(rows, 1.0, ft=2.0, position=0.1)
    _put(rows, 2.0, ft=3.0)
    assert rows == {"ft": [(1.0, 2.0), (2.0, 3.0)], "position": [(1.0, 0.1)]}


class Answer:
    """The answer to one request; comes when it is told to."""

    def add_done_callback(self, callback):
        self.come = lambda: callback(answer(8.0, 100.0, 20.0))


@pytest.fixture
def bench(monkeypatch):
    """A live view beside a bench: it, its clock, the names of the benches, and the requests so far."""
    clock, names, requests = [0.0], ["driver"], []

    def request(limits):
        requests.append(Answer())
        return requests[-1]

    client = SimpleNamespace(services_are_ready=lambda: True, get_parameters=request)
    monkeypatch.setattr(module, "AsyncParameterClient", lambda node, name: client)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    infos = {"joint_states": names, "torque_command": ["watch"]}
    node = SimpleNamespace(
        create_publisher=lambda *_: None,
        resolve_topic_name=lambda name: name,
        get_fully_qualified_name=lambda: "/watch",
        get_publishers_info_by_topic=lambda name: [
            SimpleNamespace(node_namespace="/", node_name=n) for n in infos[name]
        ],
    )
    values = {"rate": 280.0, "limit": 10.0, "growth": 40.0, "joint": "rsea"}
    return WatchCommand(node, SimpleNamespace(newest=0), values), clock, names, requests


def look_for(watch, clock, seconds):
    for _ in range(round(seconds / LOOK)):
        watch.look()
        clock[0] += LOOK


def test_limits_are_requested_again_where_the_answer_was_lost(bench):
    """DDS may lose the answer to a node that has only just been found: the page then never commanded."""
    watch, clock, _, requests = bench
    look_for(watch, clock, 4.0 * ANSWER)
    assert 2 < len(requests) <= 5 and watch.why_not == "/driver has not said its limits yet"
    requests[-1].come()
    look_for(watch, clock, 4.0 * ANSWER)
    assert watch.commander.bounds.torque == 8.0 and watch.why_not == ""
    assert len(requests) <= 5, "it asked on"


def test_limits_of_a_bench_that_has_left_do_not_count(bench):
    watch, clock, names, requests = bench
    look_for(watch, clock, LOOK)
    names[0] = "plant"
    look_for(watch, clock, LOOK)
    requests[0].come()
    assert watch.commander.bounds is None
    requests[1].come()
    assert watch.commander.bounds.torque == 8.0
