"""The door: `import rsea_ros as rsea` from arrays to a diagnosis, without ROS and without side effects."""

import functools
import json
import os
import pickle
import pydoc
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros import DOOR, STUDIES
from rsea_ros.control.law import Gains
from rsea_ros.errors import ChannelError, ParameterError
from rsea_ros.records.record import Channel

RATE = 280.0
SECONDS = 12.0


@pytest.fixture(scope="module")
def commands() -> np.ndarray:
    rng = np.random.default_rng(3)
    return 15.0 * rng.standard_normal(int(SECONDS * RATE))


@pytest.fixture(scope="module")
def record(commands) -> rsea.Record:
    rig = rsea.load_rig("paper_high_impedance").with_values({"spring.stiffness": 1480.0})
    return rsea.simulate(rig, commands, RATE, seed=1)


@pytest.fixture(scope="module")
def fit(record):
    return rsea.identify(record, "paper_high_impedance")


def in_a_fresh_interpreter(code: str) -> list[object]:
    bare = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "OPENBLAS", "MKL"))}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, env=bare)
    return json.loads(done.stdout)


def test_importing_brings_neither_ros_nor_numerics_and_opening_every_name_changes_no_variable():
    seen = in_a_fresh_interpreter(
        "import json, os, sys\n"
        "before = dict(os.environ)\n"
        "import rsea_ros as rsea\n"
        "heavy = [m for m in ('rclpy', 'numpy', 'scipy', 'numba', 'control', 'plotly') if m in sys.modules]\n"
        "names = dir(rsea)\n"
        "opened = all(callable(getattr(rsea, name)) or name == 'effects' for name in names)\n"
        "same = dict(os.environ) == before\n"
        "print(json.dumps([heavy, names, opened, same, 'rclpy' in sys.modules]))"
    )
    assert seen == [[], sorted(DOOR), True, True, False]
    assert set(rsea.__all__) == set(DOOR)


def test_arrays_lists_and_aliases_make_the_same_record():
    t, u = np.arange(4) / RATE, np.array([1.0, -2.0, 3.0, -4.0])
    record = rsea.Record.from_arrays(t, command=u, ft=0.5 * u)
    other = rsea.Record.from_arrays(list(t), u=list(u), tau=list(0.5 * u))
    for name in ("command", "ft"):
        np.testing.assert_array_equal(record[name].y, other[name].y)
    assert repr(record) == "Record('arrays', 0.01071 s: command 280 Hz, ft 280 Hz)"


def test_the_callers_arrays_stay_writable_and_are_not_shared():
    t, u = np.arange(3) / RATE, np.ones(3)
    record = rsea.Record.from_arrays(t, command=u)
    u[0] = 7.0
    assert record["command"].y[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        record["command"].y[0] = 7.0


def test_stamps_may_count_from_any_epoch():
    t = 1.7e9 + np.arange(1000) / RATE
    record = rsea.Record.from_arrays(t, command=np.ones(1000))
    assert record.start == 0.0
    assert record["command"].rate == pytest.approx(RATE, rel=1e-3)


@pytest.mark.parametrize(
    ("t", "channels", "says"),
    [
        ([0.0, 1.0], {"torq": [1.0, 2.0]}, "unknown channel 'torq', expected one of command"),
        ([0.0, 1.0], {"command": [1.0]}, "command has shape"),
        ([0.0, 1.0], {"command": [1.0, 2.0, 3.0]}, "command has 3 values for 2 stamps"),
        ([0.0, 1.0, 1.0], {"command": [1.0, 2.0, 3.0]}, "t[2] = 1 s after 1 s, expected stamps that rise"),
        ([0.0, 1.0], {"command": ["a", "b"]}, "command holds <U1, expected real numbers in N·m"),
        ([0.0, 1.0], {"command": [1, 2], "u": [1, 2]}, "name a channel twice"),
        (
            [0.0, 1.0],
            {"torque": [1, 2]},
            "'torque' may be three channels, expected command, motor_torque or ft",
        ),
        ([0.0, 1.0], {}, "no channel, expected one or more of command"),
        ([0.0, np.nan], {"command": [1, 2]}, "t[1] = nan, expected a finite value in s"),
        ([0.0, 1.0], {"command": [1, -np.inf]}, "command[1] = -inf, expected a finite value in N·m"),
        ([0.0, 1.0], {"command": [1, 2j]}, "command holds complex128, expected real numbers in N·m"),
        (np.array([0, 1j]), {"command": [1, 2]}, "t holds complex128, expected real numbers in s"),
        ([0.0, 1.0], {"position": [True, False]}, "position holds bool, expected real numbers in rad"),
        (np.array([0, 1], "m8[ms]"), {"u": [1, 2]}, "t holds timedelta64[ms], expected real numbers in s"),
    ],
)
def test_arrays_that_cannot_be_a_record_are_refused(t, channels, says):
    with pytest.raises(ChannelError) as error:
        rsea.Record.from_arrays(t, **channels)
    assert says in str(error.value)


def test_a_masked_measurement_is_missing():
    q = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    record = rsea.Record.from_arrays([0.0, 1.0, 2.0], command=[0, 0, 0], q=q)
    np.testing.assert_array_equal(record["position"].y, [1.0, np.nan, 3.0])


def test_a_missing_measurement_is_left_out_of_a_fit_and_reported(record, fit):
    """The tutorial promised NaN for a missing measurement, and identify refused it."""
    ft = np.where(np.arange(len(record["ft"])) % 100 == 7, np.nan, record["ft"].y)
    holed = rsea.identify(record.with_channels(ft=Channel(record["ft"].t, ft)), "paper_high_impedance")
    assert holed.rig["spring.stiffness"] == pytest.approx(fit.rig["spring.stiffness"], rel=2e-3)
    assert ("nan", "ft") in {(fault.kind, fault.channel) for fault in holed.result.faults}


def test_a_table_gives_its_columns():
    table = {"time": [0.0, 0.1, 0.2], "tau cmd": [1.0, 2.0, 3.0]}
    record = rsea.Record.from_dataframe(table, {"command": "tau cmd"}, time="time")
    np.testing.assert_array_equal(record["command"].y, [1.0, 2.0, 3.0])
    with pytest.raises(ChannelError, match="no column 'torque'"):
        rsea.Record.from_dataframe(table, {"command": "torque"}, time="time")


def test_a_fit_recovers_the_stiffness_and_shows_itself(fit):
    assert fit.parameters["spring.stiffness"].value == pytest.approx(1480.0, rel=0.01)
    assert fit.rig["spring.stiffness"] == fit.parameters["spring.stiffness"].value
    assert "spring.stiffness" in fit.summary() and "spring.stiffness" in repr(fit)
    assert "<table>" in fit._repr_html_()
    figure = fit.plot()
    figure.update_layout(title="mine")
    assert len(figure.data) > 3
    with pytest.raises(ParameterError, match="response = 9"):
        fit.plot(9)


def test_arguments_of_the_wrong_kind_are_named(record):
    with pytest.raises(ParameterError, match="data: ndarray, expected a Record"):
        rsea.identify([np.ones(3)], "paper_high_impedance")
    with pytest.raises(ParameterError, match="command: shape"):
        rsea.simulate("paper_high_impedance", [[1.0]])
    with pytest.raises(ParameterError, match=r"command: shape \(\) of object, expected \(n,\) finite"):
        rsea.simulate("paper_high_impedance", record)
    with pytest.raises(ParameterError, match=r"of complex128, expected \(n,\) finite torques"):
        rsea.simulate("paper_high_impedance", [1j, 2.0])
    with pytest.raises(ParameterError, match="rate: not stated"):
        rsea.simulate("paper_high_impedance", [1.0, 2.0])
    with pytest.raises(ParameterError, match="predict: expected a Record and a rig"):
        rsea.predict("paper_high_impedance", "pendulum")
    with pytest.raises(ParameterError, match="save: dict, expected a Rig, a fit"):
        rsea.save({}, "x.yaml")
    with pytest.raises(ParameterError, match=r"path 'rig.csv', expected .yaml or .yml"):
        rsea.save(rsea.load_rig("paper_high_impedance"), "rig.csv")
    with pytest.raises(ParameterError, match=r"path 'run.csv', expected .mcap or .db3"):
        rsea.save(record, "run.csv")
    with pytest.raises(ParameterError, match="rate = nan Hz"):
        rsea.simulate("paper_high_impedance", [1.0, 2.0], rate=float("nan"))


RIG = "paper_high_impedance"
LATE = [rsea.load_rig(RIG).with_effect(name) for name in ("current_loop_lag", "command_delay")]


@functools.cache
def controller() -> rsea.TorqueController:
    return rsea.TorqueController(rsea.load_rig(RIG), 280.0, Gains(0.2575, 0.003029, 1.195, 6.99, 42.9))


DOORS = {
    "read_bag": rsea.read_bag,
    "simulate a rig": lambda x: rsea.simulate(x, [1.0, 2.0], 280.0),
    "simulate a command": lambda x: rsea.simulate(RIG, x, 280.0),
    "simulate at a rate": lambda x: rsea.simulate(RIG, [1.0, 2.0], x),
    "check": lambda x: rsea.check(x, RIG),
    "identify": lambda x: rsea.identify(x, RIG),
    "diagnose": lambda x: rsea.diagnose(x, RIG),
    "predict": lambda x: rsea.predict(x, RIG),
    "law": lambda x: rsea.law(x, RIG),
    "observe": lambda x: rsea.observe(rsea.Observer(rsea.load_rig(RIG)), x),
    "observe by": lambda x: rsea.observe(x, rsea.simulate(RIG, [1.0, 2.0], 280.0)),
    "Observer": rsea.Observer,
    "TorqueController": lambda x: rsea.TorqueController(x, 280.0),
    "TorqueController at a rate": lambda x: rsea.TorqueController(rsea.load_rig(RIG), x),
    "closed_loop": lambda x: rsea.closed_loop(x, 280.0, controller(), [1.0]),
    "closed_loop at a rate": lambda x: rsea.closed_loop(rsea.load_rig(RIG), x, controller(), [1.0]),
    "closed_loop by": lambda x: rsea.closed_loop(rsea.load_rig(RIG), 280.0, x, [1.0]),
    "closed_loop to": lambda x: rsea.closed_loop(
        rsea.load_rig(RIG), 280.0, controller(), [] if isinstance(x, list) else x
    ),
    "experiment on": lambda x: rsea.experiment(x, {"torque": 20.0}, rate=280.0),
    "experiment within": lambda x: rsea.experiment(LATE, x, rate=280.0),
    "experiment at a rate": lambda x: rsea.experiment(LATE, {"torque": 20.0}, rate=x),
    "experiment for": lambda x: rsea.experiment(LATE, {"torque": 20.0}, rate=280.0, longest=x),
    "design": lambda x: rsea.design(torque=x),
    "design with a motor": lambda x: rsea.design(unit=x),
    "design with a spring": lambda x: rsea.design(stiffness=object() if x is None else x),
    "save": lambda x: rsea.save(x, "nothing.yaml"),
}
WRONG = (None, "text", [1], float("nan"), -1.0, {}, {"torque": "much"}, object(), np.ones((2, 2)), True)


@pytest.mark.parametrize("door", DOORS)
def test_whatever_a_door_is_given_it_says_so_in_its_own_words(door, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for wrong in WRONG:
        with pytest.raises(rsea.RseaError, match=r"expected|no such bag"):
            DOORS[door](wrong)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (None, "rig None: expected the name of a rig, or of a YAML file"),
        ({"name": "x"}, "rig {'name': 'x'}: expected the name of a rig"),
        ("a\0b.yaml", r"rig 'a\x00b.yaml': expected the name of a rig"),
        ("", "rig '' not found, expected a YAML file or one of"),
    ],
)
def test_an_object_that_is_not_a_rig_is_refused(name, says):
    with pytest.raises(rsea.RseaError) as error:
        rsea.load_rig(name)
    assert says in str(error.value)


def test_results_are_short_in_a_notebook(record):
    rig = rsea.load_rig("paper_high_impedance").with_effect("backlash", gap=4e-3)
    assert repr(rig).startswith("Rig('paper_high_impedance': ") and repr(rig).endswith("effects: backlash)")
    assert "spring.stiffness 1530" in repr(rig) and len(repr(rig)) < 400
    comparison = rsea.predict("paper_high_impedance", record)["ft"]
    assert repr(comparison).startswith("Comparison(") and len(repr(comparison)) < 100
    assert rsea.check(record, "paper_high_impedance")._repr_html_().startswith("<pre>green")


@pytest.mark.parametrize("name", STUDIES)
def test_the_help_of_a_study_is_that_of_its_function(name):
    shown = pydoc.render_doc(getattr(rsea, name), renderer=pydoc.plaintext)
    assert f"{name}(" in shown and "Raises ParameterError" in shown


def test_what_is_saved_is_read_back(record, fit, tmp_path):
    rsea.save(fit, tmp_path / "model.yaml")
    again = rsea.load_rig(tmp_path / "model.yaml")
    assert again["spring.stiffness"] == pytest.approx(fit.rig["spring.stiffness"], rel=1e-9)
    rsea.save(record, tmp_path / "run")
    there = rsea.read_bag(tmp_path / "run")
    np.testing.assert_allclose(there["ft"].y, record["ft"].y)
    for first, second in ((there, again), (again, there)):
        assert rsea.predict(first, second)["ft"].rms_error < 0.04, "in any order: N·m, the noise is 0.03"
    with pytest.raises(rsea.RseaError, match=r"model\.yaml"):
        fit.save(tmp_path / "model.yaml")
    other = pickle.loads(pickle.dumps((again, there)))
    assert rsea.predict(*other)["ft"].rms_error == rsea.predict(again, there)["ft"].rms_error, "processes"


def test_the_studies_answer_as_the_verbs_do(record):
    assert rsea.law(record, "paper_high_impedance").laws == ()
    wanted = rsea.design(torque=40.0, bandwidth=12.0)
    assert wanted.feasible and wanted.stiffness == pytest.approx(460.7, abs=0.1), "5 deg at 40 N·m, Eq. (8)"
    assert not rsea.design(torque=40.0, bandwidth=12.0, stiffness=260.0).feasible
    tiny = rsea.design(torque=0.02, bandwidth=0.5, inertia=1e-6)
    assert tiny.feasible and tiny.stiffness == pytest.approx(0.23, abs=0.01), "was 1: the search began there"
    with pytest.raises(ParameterError, match="stiffness = 0"):
        rsea.design(stiffness=0.0)
    with pytest.raises(ParameterError, match="demand 'torqe', did you mean torque"):
        rsea.design(torqe=40.0)
    rig = rsea.load_rig("paper_high_impedance")
    models = (
        rig.with_effect("current_loop_lag", time_constant=3e-3),
        rig.with_effect("command_delay", delay=3e-3),
    )
    advice = rsea.experiment(models, {"torque": 20.0}, rate=280.0, longest=2.0)
    assert np.abs(advice.proposal.command).max() <= 20.0
    assert re.fullmatch(r"Advice\(.*delay.*: a run of [\d.]+ s, 0 pairs that none separates\)", repr(advice))
    with pytest.raises(ParameterError, match="limits: 'torqe', expected one of torque"):
        rsea.experiment(models, {"torqe": 20.0}, rate=280.0)
    assert rsea.__version__ == "0.1.0"


class Cell:
    """The display of a notebook's cell: keeps what it shows."""

    def __init__(self):
        self.shown = []

    def display(self, value, display_id):
        self.shown.append(value)
        return SimpleNamespace(update=self.shown.append)


@pytest.fixture
def cell(monkeypatch):
    """A notebook's kernel, which runs the test."""
    made = Cell()
    shell = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "IPython", shell)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=made.display))
    return made


def test_a_notebook_shows_a_bar_that_vanishes_at_the_end(cell, record):
    rsea.identify(record, "paper_high_impedance")
    *_, last, _, cleared = cell.shown
    assert "fitting: 40 %" in map(repr, cell.shown) and "<progress value='0." in last._repr_html_()
    assert cleared._repr_html_() == "" == repr(cleared)


def test_a_check_says_what_is_wrong_and_a_fit_carries_it(record):
    dead = record.with_channels(ft=Channel(record["ft"].t, np.full(len(record["ft"]), 0.25)))
    checks = rsea.check(dead, "paper_high_impedance")
    assert checks.light != "green"
    assert "dead_channel ft" in repr(checks) and "ft" in checks.summary()
    assert rsea.check(record, "paper_high_impedance").light == "green"
    fit = rsea.identify(dead, "paper_high_impedance")
    assert [fault.kind for fault in fit.result.faults if fault.channel == "ft"] == ["dead_channel"]


def test_every_door_dates_stamps_that_repeat():
    """identify refused them (expected rising stamps); bags, check and diagnose left the repeats out."""
    rig = rsea.load_rig("paper_high_impedance")
    run = rsea.simulate(rig, 15.0 * np.random.default_rng(1).standard_normal(2800), 280.0)

    def repeating(channel):
        t = channel.t.copy()
        t[5::40] = t[4::40]
        return Channel(t, channel.y)

    record = run.with_channels(**{n: repeating(run[n]) for n in ("ft", "position", "velocity")})
    fit = rsea.identify(record, rig)
    assert fit.verdict == "adequate"
    repeats = {f.channel for f in fit.result.faults if f.kind == "duplicate_stamps"}
    assert repeats == {"ft", "position", "velocity"}
    assert rsea.diagnose(record, rig).verdict == "nothing_wrong"


@pytest.mark.parametrize("most", [0, -1])
def test_a_diagnosis_may_have_no_fewer_than_one_cause(most):
    with pytest.raises(ParameterError, match="max_causes"):
        rsea.DiagnosisSettings(max_causes=most)


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(AttributeError, match=r"no attribute 'simulat'; it offers .*simulate"):
        _ = rsea.simulat
