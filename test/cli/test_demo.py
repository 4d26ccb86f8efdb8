"""The demo as a newcomer runs it: real processes, real topics, the true values recovered."""

import os
import re
import signal
import subprocess
import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters import read_record, write_record
from rsea_ros import processes
from rsea_ros.cli import demo, main
from rsea_ros.cli._processes import Processes
from rsea_ros.errors import RseaError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Fault, Record
from test.nodes.stalls import until
from test.nodes.warm import parent

ROOT = Path(__file__).resolve().parents[2]
DOMAIN = int(os.environ["ROS_DOMAIN_ID"])


def _demo(out):
    command = [sys.executable, "-m", "rsea_ros", "demo", "--out", str(out), "--domain", str(DOMAIN)]
    return subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def _left_running(out):
    """Return the node processes that name the demo's directory on their command line."""
    lines = [
        p.read_bytes() for p in Path("/proc").glob("[0-9]*/cmdline") if p.parent.name != str(os.getpid())
    ]
    return [line for line in lines if b"rsea_ros.nodes" in line and str(out).encode() in line]


class Node:
    """A node of a demo in this process, forked; it has the part of a Popen that the demo needs."""

    def __init__(self, name, words, *, env, stdout, stderr):
        log = stdout.name
        self._child = parent().start(f"rsea_ros.nodes.{name}", words, env, (os.devnull, log, log))
        self.poll, self.kill = self._child.poll, self._child.kill
        self.terminate, self.wait = partial(self._child.send_signal, signal.SIGTERM), self._child.wait

    returncode = property(lambda self: self._child.poll())


def _play(tmp_path, capsys, monkeypatch):
    """Play the demo until the plant does not stall, three times at most; return its directory and output."""
    monkeypatch.setattr("rsea_ros.cli._processes.start", Node)
    monkeypatch.setattr(demo, "SHORT", 3.0)  # s of excitation instead of 20
    for k in range(3):
        out = tmp_path / f"demo{k}"
        assert main.main(["demo", "--out", str(out), "--domain", str(DOMAIN)]) == 0
        printed = capsys.readouterr().out
        if "WARN" not in (out / "log" / "plant.log").read_text():
            break
    return out, printed


def test_the_demo_finds_the_true_values_and_names_its_report(tmp_path, capsys, monkeypatch):
    """The verb in this process, and its nodes on topics; as a process of its own it is started below."""
    out, printed = _play(tmp_path, capsys, monkeypatch)
    assert printed.splitlines()[-1] == f"report: {out / 'report.html'}"
    assert (out / "report.html").exists() and (out / "identification.json").exists()
    assert re.search(r"^\d{4} messages recorded and replayed, 0 lost$", printed, re.MULTILINE)
    true, fitted_value, start = (
        load_rig(r) for r in (out / "bench.yaml", out / "model.yaml", "paper_high_impedance")
    )
    for name in start.free():
        low, high = fitted_value.quantities[name].ci95
        assert name in printed
        assert true[name] != start[name]
        assert abs(fitted_value[name] - true[name]) < high - low
        assert high - low < 0.2 * true[name]
    assert not _left_running(out)
    _assert_that_the_bag_says_what_the_plant_did(read_record(out / "bag"), true)


def _assert_that_the_bag_says_what_the_plant_did(recorded, rig):
    """Planned commands at a cycle's start, every measurement; beside a simulation only noise."""
    planned = excitation("chirp", ExcitationSettings(duration=3.0, seed=1), 0.5)
    command = recorded["command"]
    place = np.round((command.t - command.t[0]) * 280.0).astype(int)
    assert np.array_equal(command.y, np.append(planned, np.zeros(place[-1]))[place])
    assert place[-1] >= len(planned) and len(command) > 0.99 * place[-1]  # a busy machine leaves some out
    for name in ("position", "ft"):
        assert np.diff(recorded[name].t) == pytest.approx(1.0 / 280.0, abs=2e-9)
    phase = (command.t - recorded["position"].t[0]) * 280.0
    assert phase == pytest.approx(np.round(phase), abs=1e-5)
    simulated = simulate(rig, recorded)
    for name in ("ft", "position"):
        sensor = rig.sensors[name]
        error = (recorded[name].y - simulated[name])[recorded[name].t > command.t[0]]
        expected = np.hypot(sensor.noise, sensor.quantum / np.sqrt(12.0))
        assert np.sqrt(np.mean(error**2)) == pytest.approx(expected, rel=0.1)


def test_a_signal_leaves_no_process_and_no_half_written_bag(tmp_path):
    out = tmp_path / "demo"
    process = _demo(out)
    until((out / "log" / "excite.log").exists, 60.0)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert errors.splitlines() == ["rsea demo: stopped by SIGTERM"]
    assert not _left_running(out)
    assert not list(out.glob("*.partial*"))


def test_a_node_that_fails_while_another_is_awaited_is_named_too(tmp_path, monkeypatch):
    fails = "echo '[FATAL] [17.5] [rsea.plant]: parameter rate = 1.0, expected more'; exit 2"
    programs, begun = {"plant": ["sh", "-c", fails], "record": ["sleep", "60"]}, []

    def start(name, arguments, **options):
        begun.append(processes.start(programs[name], **options))
        return begun[-1]

    monkeypatch.setattr("rsea_ros.cli._processes.start", start)
    with Processes(tmp_path, DOMAIN) as nodes:
        nodes.start("plant", {"rate": 1})
        nodes.start("record", {"out": tmp_path / "bag"})
        with pytest.raises(RseaError, match=r"plant ended too early: parameter rate = 1.0, expected"):
            nodes.wait("record", 60.0)
    assert all(each.poll() is not None for each in begun)


def test_the_limit_of_a_node_counts_from_its_last_line(tmp_path, monkeypatch):
    """It counted from the start: beside other work a demo that got on was ended at 85 %."""
    now, is_stuck = [0.0], False
    nodes = Processes(tmp_path, DOMAIN)
    poll = lambda: 0 if now[0] > 40.0 else None  # noqa: E731
    nodes._running["replay"] = SimpleNamespace(poll=poll, returncode=0)

    def sleep(_):
        now[0] += 8.0
        with nodes.log("replay").open("a") as log:
            log.write("" if is_stuck else f"{now[0]:.0f}%\n")

    stand_in = SimpleNamespace(monotonic=lambda: now[0], sleep=sleep)
    monkeypatch.setattr("rsea_ros.cli._processes.time", stand_in)
    nodes.log("replay").touch()
    nodes.wait("replay", 10.0)
    is_stuck = True
    nodes._running["replay"] = SimpleNamespace(poll=lambda: None)
    with pytest.raises(RseaError, match=r"replay got no further for 10 s: 4.%"):
        nodes.wait("replay", 10.0)


def test_a_used_directory_is_refused(tmp_path, refused):
    (tmp_path / "demo" / "bag").mkdir(parents=True)
    line = refused("demo", "--out", tmp_path / "demo")
    assert re.fullmatch(r"rsea demo: --out .*/demo: holds a bag already, expected a new directory\n", line)


STARTS_A_NODE = """
import sys, time
from pathlib import Path
from rsea_ros.cli._processes import Processes
nodes = Processes(Path(sys.argv[1]), int(sys.argv[2]))
nodes.start("replay", {"bag": sys.argv[3], "subscribers": 9})
print("started", flush=True)
time.sleep(60.0)
"""


def test_a_demo_that_is_killed_leaves_no_node(tmp_path):
    command = [sys.executable, "-c", STARTS_A_NODE, str(tmp_path), str(DOMAIN), str(tmp_path / "bag")]
    write_record(Record({"command": Channel(np.arange(9.0), np.zeros(9))}), tmp_path / "bag")
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
    process.stdout.readline()
    assert _left_running(tmp_path)
    process.kill()
    process.communicate()
    until(lambda: not _left_running(tmp_path))


@pytest.mark.parametrize(
    ("kinds", "bag", "lines"),
    [
        (["", ""], "bag", 0),
        (["watchdog_trips", "outliers"], "bag-2", 1),
        (["commands_left_out", "watchdog_trips"], "bag-2", 2),
    ],
)
def test_a_run_that_was_disturbed_is_repeated_once(tmp_path, capsys, monkeypatch, kinds, bag, lines):
    played = []

    def read(path, strict):
        return Record({}, faults=(Fault(kinds[len(played) - 1], "command", 0.1),))

    monkeypatch.setattr(demo, "source", lambda nodes, out, args: nullcontext("plant"))
    monkeypatch.setattr(demo, "measure", lambda nodes, path, *rest: played.append(path))
    monkeypatch.setattr(demo, "read_record", read)
    assert demo.record_bench(None, tmp_path, 20.0, SimpleNamespace(seed=1)) == tmp_path / bag == played[-1]
    told = " ".join(capsys.readouterr().out.split())
    assert told.count("this machine was too busy (") == lines
    assert told.count("once more") == min(lines, 1)
    assert told.endswith("the results come from a disturbed run") == (lines == 2)
