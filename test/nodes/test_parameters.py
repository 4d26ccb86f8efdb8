"""Parameters: what ROS is told of them, and a wrong value is refused in one line with status 2."""

import importlib
import math
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from rsea_ros.errors import ParameterError
from rsea_ros.nodes import _parameters
from rsea_ros.nodes._parameters import DERIVED, NodeParameter, _descriptor, _refuse_unknown, stated_limits
from rsea_ros.plugins import node_modules
from rsea_ros.processes import ENDING
from test.nodes.conftest import as_argument

CONFIG = Path(__file__).resolve().parents[2] / "config" / "nodes"
NODES = {name: module for name, module in node_modules().items() if name != "joint"}
RATE = NodeParameter("rate", 280.0, "samples a second", "Hz", 10.0, 1000.0)
COUNT = NodeParameter("count", 3, "how many", "", 0, 10)
KIND = NodeParameter("kind", "a", "which", choices=("a", "b"))
FLAG = NodeParameter("flag", False, "whether")


@pytest.mark.parametrize(
    ("parameter", "value", "message"),
    [
        (RATE, 1001.0, "rate = 1001.0, expected a number from 10 to 1000 Hz"),
        (RATE, 9.9, "rate = 9.9"),
        (RATE, math.nan, "rate = nan"),
        (RATE, "fast", "rate = 'fast'"),
        (RATE, True, "rate = True"),
        (COUNT, 2.0, "count = 2.0, expected a whole number from 0 to 10"),
        (COUNT, 11, "count = 11"),
        (KIND, "c", "kind = 'c', expected one of a, b"),
        (KIND, 1, "kind = 1"),
        (FLAG, 1, "flag = 1, expected true or false"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(parameter, value, message):
    with pytest.raises(ParameterError, match=message):
        parameter.check(value)


def test_a_value_that_fits_comes_in_its_type():
    assert RATE.check(280) == 280.0 and isinstance(RATE.check(280), float)
    assert (RATE.check(10.0), RATE.check(1000.0), COUNT.check(0)) == (10.0, 1000.0, 0)
    assert KIND.check("b") == "b" and FLAG.check(True) is True


def test_parameter_file_and_table_agree():
    for name, module in NODES.items():
        document = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())
        table = importlib.import_module(module).TABLE
        assert document["/**"]["ros__parameters"] == {p.name: p.default for p in table}, name
        for parameter in table:
            assert parameter.check(parameter.default) == parameter.default
            assert parameter.description


WRONG = {
    "controller": (
        {"k_p": 30.0, "k_d": 0.1, "k_i": 1.0, "q_frequency": 50.0, "k_w": 0.0},
        "unstable at 280 Hz with load 'locked'",
    ),
    "plant": ({"rate": 5000}, "parameter rate = 5000.0, expected a number from 10 to 1000 Hz"),
    "driver": ({"device": "motor"}, "parameter device = 'motor', expected one of simulated"),
    "excite": ({"amplitude": 60.0, "duration": 5.0}, "expected at most 68 N·m either way"),
    "experiment": ({"limits": "velocity=1"}, "no torque, expected at least torque="),
    "record": ({"out": "/dev/null/bag"}, "/dev/null"),
    "replay": ({"bag": "no/such/bag"}, "no/such/bag: no such bag"),
    "model": ({"tolerance_deg": 91.0}, "tolerance_deg = 91.0, expected a number from 0.1 to 90 °"),
    "watch": ({"host": "192.0.2.7"}, "page on 192.0.2.7, port 8270: Cannot assign requested address"),
    "identify": ({"rigg": "x"}, "parameter rigg: no such parameter, expected one of rig, out"),
}
PROCESSES = ("controller", "driver", "plant")
"""Nodes that are started as processes: how they publish and live stays with a process."""


def test_a_process_refuses_what_is_wrong_in_one_line_with_status_2(start):
    processes = {name: start(name, **WRONG[name][0]) for name in PROCESSES}
    for name, process in processes.items():
        assert process.wait() == 2, name
        assert_refused(name, process.output)


def assert_refused(name, lines):
    assert len(lines) == 1, lines
    assert WRONG[name][1] in lines[0]
    assert "FATAL" in lines[0]


@pytest.fixture
def signals():
    """Restore what signals do, which a node changes."""
    before = {number: signal.getsignal(number) for number in ENDING}
    yield
    for number, action in before.items():
        if action is not None:
            signal.signal(number, action)


@pytest.mark.parametrize("name", sorted((WRONG.keys() & NODES.keys()) - set(PROCESSES)))
def test_every_node_refuses_what_is_wrong_in_one_line_with_status_2(name, signals, monkeypatch, capfd):
    words = [w for key, value in WRONG[name][0].items() for w in ("-p", f"{key}:={as_argument(value)}")]
    monkeypatch.setattr(sys, "argv", [name, "--ros-args", *words])
    assert importlib.import_module(NODES[name]).main() == 2
    assert_refused(name, "".join(capfd.readouterr()).splitlines())


@pytest.mark.parametrize("name", ["joint", "model"])
def test_what_ros_cannot_read_is_refused_in_words_with_status_2(name, signals, monkeypatch, capfd):
    monkeypatch.setattr(sys, "argv", [name, "--ros-args", "-r", "__ns:=/_0/a1__b"])
    assert importlib.import_module(f"rsea_ros.nodes.{name}").main() == 2
    *_, last = "".join(capfd.readouterr()).splitlines()
    assert "FATAL" in last and "ROS arguments" in last and "__ns:=/_0/a1__b" in last


def test_a_node_that_is_interrupted_while_it_imports_says_so_in_one_line():
    code = "import rsea_ros.nodes\nraise KeyboardInterrupt"
    done = subprocess.run([sys.executable, "-c", code], cwd=CONFIG.parents[1], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "interrupted before it began\n")


def test_a_mistyped_parameter_is_answered_with_the_right_one():
    with pytest.raises(ParameterError, match=r"parameter amplitud: .*, did you mean amplitude\?"):
        _refuse_unknown({"amplitud": 3.0}, [NodeParameter("amplitude", 20.0, "peak", "N m", 0.0, 1e4)])


@pytest.mark.parametrize(
    ("parameter", "about", "expected", "bounds"),
    [
        (NodeParameter("a", 1.0, "s", "N m", 0.0, 2.0), "s, N·m", "a number from 0 to 2 N·m", (0.0, 2.0)),
        (NodeParameter("b", 3, "count", "", 1.0, 9), "count", "a whole number from 1 to 9", (1, 9)),
        (NodeParameter("c", True, "whether"), "whether", "true or false", None),
        (NodeParameter("d", "x", "kind", choices=("x", "y")), "kind", "one of x, y", None),
        (NodeParameter("e", ["x"], "names"), "names", "a list of texts", None),
    ],
)
def test_a_range_is_told_in_the_type_of_its_parameter(monkeypatch, parameter, about, expected, bounds):
    monkeypatch.setattr(_parameters, "parameter_descriptor", lambda *told, fixed: (*told, fixed))
    told = _descriptor(parameter)
    assert told == (about, f"expected {expected}", bounds, True)
    if bounds is not None:
        assert [type(v) for v in told[2]] == [type(parameter.default)] * 2


@pytest.mark.parametrize(("value", "limit"), [(5.0, 5.0), (0.0, math.inf), (DERIVED, None)])
def test_a_limit_of_zero_is_none_but_that_of_the_torque(value, limit):
    assert stated_limits({"slew_limit": value}, ["slew"]) == ({} if limit is None else {"slew": limit})
    torque = stated_limits({"torque_limit": value}, ["torque"])
    assert torque == ({} if limit is None else {"torque": value})
    with pytest.raises(ParameterError, match=r"slew_limit = -2, expected -1 to derive it, or at least 0"):
        stated_limits({"slew_limit": -2.0}, ["slew"])
