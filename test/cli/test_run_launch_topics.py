"""Nodes without a `ros2` command: run, launch, topics and call."""

import os
import re
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from bad_input import rsea as played
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import Trigger
from rsea_ros import processes
from rsea_ros.cli import main as cli, run
from rsea_ros.cli.launch import node_calls, together
from rsea_ros.cli.run import ros_arguments
from rsea_ros.errors import ParameterError
from rsea_ros.nodes import _visitor
from rsea_ros.plugins import node_modules
from test.nodes.warm import parent

ROOT = Path(__file__).resolve().parents[2]


def test_every_node_of_the_graph_exists():
    content = yaml.safe_load((ROOT / "launch" / "graph.yaml").read_text())
    assert {*content["first"], *content["others"]} <= set(node_modules())


def test_a_graph_starts_its_first_node_and_the_requested_ones():
    started = [call.name for call in node_calls("simulation", [])]
    assert started == ["plant", "model", "identify"]
    asked = node_calls(
        "hardware", ["identify:=false", "record:=true", "port:=/dev/ttyACM0", "namespace:=/left"]
    )
    assert [call.name for call in asked] == ["driver", "model", "record"]
    assert asked[0].parameters["port"] == "/dev/ttyACM0" and asked[0].parameters["autostart"] == "false"
    assert "__ns:=/left" in asked[1].arguments


@pytest.mark.parametrize("wrong", ["rig", "rigg:=x", "model:=perhaps"])
def test_a_wrong_argument_is_refused_before_anything_starts(wrong):
    with pytest.raises(ParameterError):
        node_calls("simulation", [wrong])


def test_parameters_are_passed_on_as_ros_reads_them():
    assert ros_arguments(["rig:=pendulum", "rate:=500.0"]) == [
        "--ros-args", "-p", "rig:=pendulum", "-p", "rate:=500.0", "--",
    ]  # fmt: skip
    with pytest.raises(ParameterError):
        ros_arguments(["pendulum"])


def test_a_node_that_fails_ends_the_others(monkeypatch, capsys):
    programs, begun = {"plant": ["sleep", "60"], "model": ["sh", "-c", "exit 2"]}, []

    def start(name, arguments):
        begun.append(processes.start(programs[name]))
        return begun[-1]

    monkeypatch.setattr("rsea_ros.cli.launch.start", start)
    assert together(dict.fromkeys(programs, ())) == 2
    assert "model ended with status 2" in capsys.readouterr().out
    assert [each.poll() for each in begun] == [-signal.SIGTERM, 2]


@pytest.mark.parametrize("words", ["run plant", "launch simulation", "topics", "call", "demo"])
def test_without_ros_one_line_says_what_is_needed(words, monkeypatch, capsys):
    monkeypatch.setattr("rsea_ros.cli._processes.find_spec", lambda name: None)
    assert cli.main(words.split()) == 2
    assert "rclpy is missing" in capsys.readouterr().err


def rsea(*words: str) -> list[str]:
    """Return the command of a verb."""
    return [sys.executable, "-m", "rsea_ros", *words]


def first_message(topic: str, *running: subprocess.Popen[bytes]) -> dict[str, Any]:
    """Return the first message of a topic while some processes run."""
    while all(process.poll() is None for process in running):  # a plant compiles its simulation first
        echo = played("topics", "echo", topic)
        if echo.returncode == 0:
            message: dict[str, Any] = yaml.safe_load(echo.stdout.split("---")[0])
            return message
    said = [p.stderr.read() for p in running if p.stderr and p.poll() is not None]
    raise AssertionError(f"ended before {topic} was published: {said}")


def test_a_launched_graph_hears_the_documented_controller_and_one_signal_ends_it(tmp_path):
    page = (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0]
    (tmp_path / "my_controller.py").write_text(code)
    graph = subprocess.Popen(rsea("launch", "simulation", "model:=false", "identify:=false"), cwd=ROOT)
    controller = subprocess.Popen(
        rsea("run", "my_controller.py"), cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    try:
        assert abs(first_message("torque_command", graph, controller)["effort"][0]) > 0.0
        controller.send_signal(signal.SIGINT)
        assert "KeyboardInterrupt" not in controller.communicate(timeout=20)[1]
    finally:
        controller.kill()
        controller.wait()
        graph.send_signal(signal.SIGTERM)
    assert graph.wait(20) == 128 + signal.SIGTERM


def call(*words: str) -> subprocess.CompletedProcess[str]:
    return played("call", *words)


@pytest.fixture
def visitor():
    """A node beside /rsea/mute, whose lifecycle never answers, as that of a node that hangs."""
    with _visitor.visit("visitor") as node:
        mute = LifecycleNode("mute", namespace="rsea")
        mute.create_service(Trigger, "~/stop", lambda request, answer: answer)
        yield node
        mute.destroy_node()


def test_a_node_that_hangs_is_listed_as_such(visitor, monkeypatch):
    monkeypatch.setattr(_visitor, "DISCOVERY", 0.1)
    caller = _visitor.Caller(visitor)
    assert any("/rsea/mute" in caller.callable_nodes(0.0) for _ in _visitor._looks(3.0))
    assert caller.offer("/rsea/mute") == ("no answer", "-")


def test_a_named_node_is_listed_without_a_question_to_the_others(visitor, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(_visitor, "visit", lambda name: nullcontext(visitor))
    monkeypatch.setattr(_visitor.Caller, "actions", lambda self, name: asked.append(name) or ("stop",))
    monkeypatch.setattr(_visitor.Caller, "_offers", lambda self, name: True)
    assert cli.main(["call", "visitor"]) == 0
    assert set(asked) == {"/rsea/visitor"} and "stop" in capsys.readouterr().out


def test_a_stop_asks_nothing_but_its_own_service(visitor, monkeypatch):
    """It was the fourth question, each of which a busy machine answers late or loses."""
    asked, answer = [], SimpleNamespace(success=True, message="off")
    monkeypatch.setattr(_visitor.Caller, "_ask", lambda self, kind, name, *more: asked.append(name) or answer)
    assert _visitor.Caller(visitor).call("mute", "stop") == "/rsea/mute: off"
    assert asked == ["/rsea/mute/stop"]


def test_a_driver_is_activated_stopped_and_cleared_by_calls(tmp_path):
    said = tmp_path / "said"
    said.touch()
    words = ["--ros-args", "-p", "device:=simulated"]
    driver = parent().start("rsea_ros.nodes.driver", words, dict(os.environ), (os.devnull, said, said))
    try:
        while not re.search("unconfigured .*clear_fault", call("driver").stdout) and driver.poll() is None:
            pass  # a driver takes some seconds to start, and its services are seen one after another
        ways = call("driver", "configure", "activate", "stop", "deactivate", "cleanup", "clear_faults")
        states = [line.removeprefix("/rsea/driver: ") for line in ways.stdout.splitlines()]
        assert [states[0], states[1], *states[3:]] == ["inactive", "active", "inactive", "unconfigured"], ways
        assert states[2].startswith("stop: torque zero until clear_fault")
        assert "'clear_faults' while unconfigured, expected one of: configure" in ways.stderr
        assert "did you mean clear_fault?" in ways.stderr
    finally:
        driver.send_signal(signal.SIGTERM)
        status = driver.wait(20)
    assert status == 0


def test_a_visitor_does_not_propose_itself(visitor, monkeypatch):
    monkeypatch.setattr(_visitor, "_SEARCH", 0.1)
    with pytest.raises(ParameterError) as error:
        _visitor.Caller(visitor).full_name("visitr")
    assert "node /rsea/visitr: it does not run" in str(error.value)
    assert "did you mean /rsea/visitor" not in str(error.value)


def test_a_joint_is_run_of_the_kinds_that_are_named_with_parameters_for_all(monkeypatch):
    started = []
    monkeypatch.setattr(run, "become", started.append)
    words = ["plant", "rate:=100.0", "model"]
    run.run(SimpleNamespace(node="joint", parameters=words, params=False, pass_on=["-r", "__ns:=/left"]))
    assert started == [[
        "-m", "rsea_ros.nodes.joint", "plant", "model", "--ros-args", "-p", "rate:=100.0", "--", "-r",
        "__ns:=/left",
    ]]  # fmt: skip
