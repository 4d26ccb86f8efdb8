"""The limits of a bench, which the live view requests before it commands."""

from types import SimpleNamespace

import pytest

from rsea_extras.watch import node as module
from rsea_extras.watch.node import ANSWER, LOOK, WatchCommand


class Answer:
    """The answer to one request; comes when it is told to."""

    torque = 8.0

    def add_done_callback(self, callback):
        self.come = lambda: callback(self)

    def result(self):
        values = (self.torque, 100.0, 20.0)
        return SimpleNamespace(values=[SimpleNamespace(type=3, double_value=v) for v in values])


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


def test_a_torque_limit_that_the_driver_derives_leaves_the_limit_of_the_page(bench):
    """It is -1 as a parameter: no command would have passed."""
    watch, clock, _, requests = bench
    look_for(watch, clock, LOOK)
    requests[0].torque = -1.0
    requests[0].come()
    assert watch.commander.bounds.torque == 10.0


def test_limits_of_a_bench_that_has_left_do_not_count(bench):
    watch, clock, names, requests = bench
    look_for(watch, clock, LOOK)
    names[0] = "plant"
    look_for(watch, clock, LOOK)
    requests[0].come()
    assert watch.commander.bounds is None
    requests[1].come()
    assert watch.commander.bounds.torque == 8.0
