"""What identify says of its work and when it ends, without ROS."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest

from rsea_ros.errors import RseaError
from rsea_ros.nodes import identify as module
from rsea_ros.nodes._health import OK, WARN, NodeHealth
from rsea_ros.nodes.identify import (
    AwaitableResult,
    Diagnosing,
    IdentifyNode,
    diagnosis_report,
    report_of,
)


@pytest.fixture
def node(monkeypatch):
    """Return a node whose clock stands at 10 s, and the lines of its log."""
    made, lines = IdentifyNode.__new__(IdentifyNode), []
    monkeypatch.setattr(module.time, "monotonic", lambda: 10.0)
    log = SimpleNamespace(info=lambda text, **k: lines.append(text), warning=lines.append)
    made._node = SimpleNamespace(get_logger=lambda: log, count_publishers=lambda topic: made.publishers)
    made.publishers, made.lines, made._values = 0, lines, {"quiet": 1.0, "stay": False}
    made._commanded, made._asked, made._done, made._answering, made._identified = 0.0, False, False, 0, None
    taps = {"torque_command": (30, 1), "ft": (20, 2), "deflection": (0, 0)}
    made._ears = SimpleNamespace(
        topics=SimpleNamespace(topic=lambda role: f"/rsea/{role}"),
        taps={n: SimpleNamespace(count=c, lost=lost) for n, (c, lost) in taps.items()},
        record=lambda strict: f"record, strict {strict}",
    )  # fmt: skip
    made._diagnosing = SimpleNamespace(report=lambda: None, close=lambda: lines.append("closed"))
    made._health = SimpleNamespace(publish=lambda: lines.append("health"))
    return made


@pytest.mark.parametrize(
    ("changes", "ends"),
    [
        ({}, False), ({"_commanded": 8.9}, True), ({"_commanded": 9.1}, False),
        ({"_commanded": 8.9, "publishers": 1}, False), ({"_commanded": 8.9, "_answering": 1}, False),
        ({"_asked": True}, True), ({"_asked": True, "_answering": 1}, False),
        ({"_commanded": 8.9, "_values": {"quiet": 1.0, "stay": True}}, False),
        ({"_asked": True, "_values": {"quiet": 1.0, "stay": True}}, True),
    ],
)  # fmt: skip
def test_it_ends_once_the_commands_are_over_or_when_it_is_told(node, changes, ends):
    vars(node).update(changes)
    assert node.is_finished() == ends == node._done


def test_it_tells_what_it_has_heard(node):
    node._tell()
    node._heard("ft")
    assert node._commanded == 0.0
    node._heard("torque_command")
    assert node._commanded == 10.0
    node._tell()
    node._progress("fit", 0.25)
    progress = "30 torque_command, 20 ft, 3 lost"
    assert node.lines == ["waiting for torque_command", progress, "25% fit"]
    answer = node._on_finish(None, SimpleNamespace())
    assert answer.success and answer.message == f"identifying from {progress}" and node._asked
    node.close()
    assert node.lines[-1] == "closed"
    node.conclude()  # stopped before: nothing is identified
    assert node.lines[-1] == "closed"


def test_the_report_is_of_the_result_or_the_diagnosis_or_the_messages(node):
    counts = {"torque_command": 30, "ft": 20, "deflection": 0}
    assert node._report() == NodeHealth(WARN, "3 messages lost", counts)
    for tap in node._ears.taps.values():
        tap.lost = 0
    assert node._report() == NodeHealth(OK, "gathering", counts)
    node._diagnosing.report = lambda: NodeHealth(WARN, "friction", {"verdict": "x"})
    assert node._report() == NodeHealth(WARN, "friction", counts | {"verdict": "x"})
    node._identified = NodeHealth(OK, "done", {})
    assert node._report() == node._identified


def test_a_diagnosis_answers_with_its_sentence_or_why_not(node, monkeypatch):
    monkeypatch.setattr(module, "diagnosis_sentence", lambda d: f"sentence of {d}")

    async def answer():
        assert node._answering == 1
        return "it"

    given = []
    node._diagnosing.begin = lambda record: given.append(record) or answer()
    told = asyncio.run(node._on_diagnose(None, SimpleNamespace()))
    assert told.success and told.message == "sentence of it" and given == ["record, strict False"]
    assert node.lines == ["sentence of it", "health"] and node._answering == 0

    def fails(record):
        raise RseaError("too\n short")

    node._diagnosing.begin = fails
    told = asyncio.run(node._on_diagnose(None, SimpleNamespace()))
    assert not told.success and told.message == "too short" and node._answering == 0


def test_one_diagnosis_runs_at_a_time_and_says_its_step(monkeypatch):
    monkeypatch.setattr(module, "check_diagnosable", lambda record: None)
    monkeypatch.setattr(module, "diagnosis_report", lambda result, report: (result, report))
    work = Diagnosing(None, Path("out"))
    assert work.report() is None and not work.busy
    goes_on, begun = threading.Event(), threading.Event()

    def diagnose(record):
        work._tell("fitting", 0.5)
        begun.set()
        goes_on.wait(5.0)
        if record == "bad":
            raise RseaError("no command")
        return record

    work._diagnose = diagnose
    awaited = work.begin("good")
    begun.wait(5.0)
    assert work.busy and work.report() == NodeHealth(OK, "diagnosing: fitting", {})
    with pytest.raises(RseaError, match=r"under way \(fitting\)"):
        work.begin("good")
    pauses = awaited.__await__()
    assert next(pauses) is None
    goes_on.set()
    with pytest.raises(StopIteration) as end:
        for _ in range(500):
            next(pauses)
    assert end.value.value == "good" and work.report() == ("good", Path("out") / module.REPORT)
    work.begin("bad")
    work._work.exception(5.0)
    work.close()
    assert work.report() == NodeHealth(WARN, "diagnosis failed: no command", {})
    with pytest.raises(RseaError, match="the node is closing"):
        work._tell("more", 0.9)
    done: Future = Future()
    done.set_result(3)
    with pytest.raises(StopIteration):
        next(AwaitableResult(done).__await__())


def test_a_result_is_fine_without_faults_and_has_sizes_with_units(monkeypatch):
    monkeypatch.setattr(module, "fault_lines", lambda faults: [f"line of {f}" for f in faults])
    monkeypatch.setattr(module, "verdict_sentence", lambda result: "a sentence")
    monkeypatch.setattr(module, "diagnosis_sentence", lambda result: "another")
    stiffness = SimpleNamespace(name="spring.stiffness", value=1499.98765, unit="N m/rad")
    for verdict, faults, level in (
        ("adequate", (), OK), ("adequate", ("a", "b"), WARN), ("inadequate", (), WARN)
    ):  # fmt: skip
        result = SimpleNamespace(verdict=verdict, faults=faults, parameters=[stiffness])
        lines = "; ".join(f"line of {f}" for f in faults)
        assert report_of(result, Path("r")) == NodeHealth(level, "a sentence", {
            "verdict": verdict, "faults": lines, "spring.stiffness": "1499.99 N·m/rad", "report": Path("r"),
        })  # fmt: skip
    gap = SimpleNamespace(value=0.00412345678, unit="rad")
    causes = [SimpleNamespace(name="backlash", parameters={"gap": gap}, gain_holdout=0.51234,
                              status="confirmed", probability=0.987)]  # fmt: skip
    for verdict, faults, level in (
        ("nothing_wrong", (), OK), ("nothing_wrong", ("a",), WARN), ("explained", (), WARN)
    ):  # fmt: skip
        found = SimpleNamespace(verdict=verdict, faults=faults, causes=causes)
        assert diagnosis_report(found, Path("r")) == NodeHealth(level, "another", {
            "verdict": verdict, "causes": "backlash", "backlash.gap": "0.00412346 rad",
            "backlash.gain": "0.5123", "backlash.status": "confirmed", "backlash.probability": "0.99",
            "faults": "; ".join(f"line of {f}" for f in faults), "report": Path("r"),
        })  # fmt: skip
