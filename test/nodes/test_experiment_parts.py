"""Who approves, plays and ends the runs of an experiment, without ROS."""

from __future__ import annotations

import threading
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.errors import DeviceError, ParameterError, RseaError
from rsea_ros.nodes import experiment as module
from rsea_ros.nodes._health import OK, WARN, NodeHealth
from rsea_ros.nodes.experiment import ExperimentNode, _end


@pytest.fixture
def node(monkeypatch):
    """Return a node without its threads, and what it did."""
    made, calls = ExperimentNode.__new__(ExperimentNode), []
    for name in ("shape_words", "end_sentence", "known_causes"):
        monkeypatch.setattr(module.words, name, lambda what, name=name: f"{name} of {what}")
    log = SimpleNamespace(info=calls.append, warning=calls.append)
    made._node, made.calls = SimpleNamespace(get_logger=lambda: log), calls
    made._values = {"ask": True, "approval": 10.0, "bag": "a,,b", "lead": 0.1, "joint": "hip"}
    made._out, made._runs, made._cancelled, made._changed = Path("out"), 0, "", threading.Condition()
    made._trial = made._proposal = made._round = made._answer = None
    made._work = Future()
    made._health = SimpleNamespace(publish=lambda: calls.append("health"))
    made._ears, made._publisher, made._bench = "ears", "publisher", SimpleNamespace(idle="", largest=0.0)
    return made


def trial(node, *, waits=0.0, over=False, record="record"):
    return SimpleNamespace(
        waits=lambda: waits, over=lambda: over, close=lambda: node.calls.append("closed"),
        stop=lambda why: node.calls.append(("stop", why)), record=lambda: record,
    )  # fmt: skip


def ask(node, answer):
    response = node._take_answer(answer, None, SimpleNamespace())
    return response.success, response.message


@pytest.mark.parametrize(("answer", "said"), [(True, "plays"), (False, "does not play")])
def test_an_answer_counts_while_a_run_waits_for_one(node, answer, said):
    assert ask(node, answer) == (False, "no run waits for an answer")
    node._proposal = "it"
    assert ask(node, answer) == (True, f"{said}: shape_words of it") and node._answer is answer
    assert ask(node, answer) == (False, "no run waits for an answer")
    assert node._is_answered() == (not answer)


def test_a_cancel_stops_the_run_under_way_and_ends_the_wait(node):
    node._proposal = "it"
    assert not node._is_answered()
    response = node._cancel(None, SimpleNamespace())
    assert response.success and response.message.startswith("goes softly to zero torque")
    assert node._is_answered() and node.calls == []
    node._trial = trial(node)
    assert not node._is_answered()  # until it has come to zero
    node._cancel(None, SimpleNamespace())
    assert node.calls == [("stop", "cancelled by ~/cancel")]
    node._proposal = None
    assert node._is_answered()


def test_an_approved_run_begins_and_is_closed_when_it_is_over(node, monkeypatch):
    made = trial(node)
    monkeypatch.setattr(module, "LiveRun", lambda ears, player: node.calls.append((ears, player)) or made)
    monkeypatch.setattr(module, "Player", lambda *a, **k: (a[1:], k))
    node._look()
    command = np.array([1.0, -3.0])
    node._proposal = SimpleNamespace(command=command, rate=280.0)
    node._look()
    assert node.calls == [] and node._trial is None
    node._answer = True
    node._look()
    options = {"lead": 0.1, "wanted": 2, "joint": "hip", "publisher": "publisher"}
    assert node._trial is made and node.calls == [("ears", ((command, 280.0, node._bench), options))]
    assert node._bench.largest == 3.0
    node._look()
    assert node._proposal is not None and len(node.calls) == 1
    made.over = lambda: True
    node._look()
    assert node._proposal is None and node.calls[1:] == ["closed"] and node._trial is made


@pytest.mark.parametrize(
    ("waits", "is_asked", "expires"), [(10.1, True, True), (9.9, True, False), (10.1, False, False)]
)
@pytest.mark.parametrize("idle", ["", "/rsea/driver is not active"])
def test_an_approval_expires_where_no_bench_comes(node, waits, is_asked, expires, idle):
    node._bench.idle = idle
    node._proposal, node._answer, node._trial = "it", True, trial(node, waits=waits)
    node._values["ask"] = is_asked
    node._look()
    assert (node._trial is None) == (node._answer is None) == expires and node._proposal == "it"
    said = ["closed", f"{idle or 'no bench'} within 10 s: the approval has expired"]
    assert node.calls == (said if expires else [])


def test_a_run_that_was_played_is_written_and_a_declined_one_is_none(node, monkeypatch):
    monkeypatch.setattr(module, "write_record", lambda record, path: node.calls.append((record, path)))

    def answered(answer):
        def wait_for(condition):
            assert not condition() or not answer
            node._trial, node._proposal = (trial(node) if answer else None), None

        node._changed.wait_for = wait_for
        return node._play("it")

    assert answered(True) == "record" and node.calls == [("record", Path("out") / "run-1.mcap")]
    assert node._trial is None and node._runs == 1
    assert answered(False) is None and node._runs == 1
    node._values["ask"] = False
    answered(True)
    assert node._answer is True and node._runs == 2


def test_it_begins_with_its_bags(node, monkeypatch):
    monkeypatch.setattr(module, "read_record", lambda bag, strict: (bag, strict))
    node._campaign = SimpleNamespace(go=lambda records: records)
    assert node._go() == [("a", False), ("b", False)]
    node._values["bag"] = ","
    with pytest.raises(ParameterError, match="expected what was recorded so far"):
        node._go()
    node._hear(SimpleNamespace(weighing="w", proposal=SimpleNamespace(resolved=0.254)))
    assert node.calls[0] == "known_causes of w" and node.calls[1].endswith("; 25% expected to be decided")


def test_the_report_says_what_it_does_or_how_it_ended(node):
    assert node._report() == NodeHealth(OK, "designs", {"runs": 0}) and not node.is_finished()
    node._proposal = "it"
    assert node._report() == NodeHealth(OK, "waits for ~/approve", {"runs": 0, "run": "shape_words of it"})
    node._answer, node._trial = True, trial(node)
    weighing = SimpleNamespace(probability={"backlash": 0.98765})
    node._round = SimpleNamespace(weighing=weighing)
    report = node._report()
    assert report.summary == "plays" and report.values["backlash"] == "0.988"
    outcome = SimpleNamespace(end="confirmed", weighing=weighing)
    for end, level in (("confirmed", OK), ("nothing_wrong", OK), ("budget", WARN)):
        outcome.end, node._work = end, Future()
        node._work.set_result(outcome)
        assert node._report() == NodeHealth(level, f"end_sentence of {outcome}", {"backlash": 0.98765})
    node._work = Future()
    node._work.set_exception(RseaError("broken"))
    assert node.is_finished() and node._report().summary == "plays"


def test_the_end_is_written_with_a_diagnosis_of_all_runs(node, monkeypatch):
    node._campaign = SimpleNamespace(rig="rig", causes="causes")
    monkeypatch.setattr(module.words, "write_campaign", lambda outcome, campaign, out: out / "report.html")
    monkeypatch.setattr(module, "diagnose_together", lambda *a: a)
    monkeypatch.setattr(module, "diagnosis_sentence", lambda verdict: f"sentence of {verdict}")
    monkeypatch.setattr(module, "write_diagnosis", lambda *a: node.calls.append(a[1]))
    node.conclude()
    assert node.calls == []
    outcome = SimpleNamespace(seconds=12.0, records=["first", "last"], end="budget")
    node._work.set_result(outcome)
    node.conclude()
    said = "diagnosis of all runs: sentence of (['first', 'last'], 'rig', 'causes')"
    assert node.calls == [f"end_sentence of {outcome}", "health", "last", said, "report: out/report.html"]
    monkeypatch.setattr(module, "write_diagnosis", lambda *a: (_ for _ in ()).throw(RseaError("no\n room")))
    assert node._diagnose(outcome) == "none: no room"
    node.calls.clear()
    outcome.seconds = 0.0
    node.conclude()
    assert node.calls == [f"end_sentence of {outcome}", "health", "report: out/report.html"]


def test_closing_takes_the_torque_first(node):
    node._campaign = SimpleNamespace()
    node._pool = SimpleNamespace(shutdown=lambda **k: node.calls.append(k))
    node._proposal, node._trial = "it", trial(node)
    node.close()
    assert node.calls == [("stop", "the node is closing"), "closed", {"cancel_futures": True}]
    assert node._proposal is None and node._campaign.tell is _end
    with pytest.raises(DeviceError, match="the node is closing"):
        _end("step", 0.5)
    node.calls.clear()
    node._cancelled = "cancelled by ~/cancel"
    node.close()
    assert node.calls == [{"cancel_futures": True}] and node._cancelled == "cancelled by ~/cancel"
