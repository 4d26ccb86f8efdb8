"""The experiment node asks before it plays, stops softly at any sample, and ignores a cancelled run."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters import write_record
from msg_adapters.ros import DiagnosticArray, JointState, Trigger, stamp_of
from rsea_ros.experiment.run_shape import Shape, command_of, run_text
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from rsea_ros.nodes.excite import plan
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"
RATE = 280.0
LIMIT = 8.0
STALLS = "no measurement", "commands came too late"
"""Why a run ends on a machine that stands still."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A bench with a slow current loop, and a bag that does not show it."""
    folder = tmp_path_factory.mktemp("bench")
    rig = load_rig(RIG).with_effect("current_loop_lag", time_constant=4e-3)
    save_rig(rig, folder / "bench.yaml")
    t = np.arange(round(2.5 * RATE)) / RATE
    slow = synthesize(rig, Channel(t, 0.2 * np.sin(2.0 * np.pi * 0.2 * t)), seed=2)
    write_record(slow, folder / "slow.mcap")
    return folder


@pytest.fixture
def ask(listener):
    """A function that calls a service of the node and returns its answer."""

    return lambda name: listener.call(f"/rsea/experiment/{name}")


@pytest.fixture
def session(bench, start, listener, tmp_path):
    """A function that starts a plant and a node that asks; the plant ends with the test.

    driven: parameters of a driver in its place.
    """
    plants, nodes = [], []  # one of an earlier test would answer for one that was killed

    def end():
        for process in plants + nodes:
            process.kill()

    def begin(driven=(), **values):
        end()
        listener.hang_up()
        commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)
        health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        kind, out = "driver" if driven else "plant", tmp_path / f"out{len(plants)}"
        plant = start(kind, rig=bench / "bench.yaml", **dict(driven))
        node = start(
            "quick_experiment", rig=RIG, bag=bench / "slow.mcap", out=out,
            causes="current_loop_lag", limits=f"torque={LIMIT}", **values,
        )  # fmt: skip

        def waits():
            texts = [s.message for m in health for s in m.status if "experiment" in s.name]
            return any("waits for ~/approve" in t for t in texts) or not node.is_running()

        plants.append(plant)
        nodes.append(node)
        listener.until(waits)
        assert node.is_running(), node.output
        return SimpleNamespace(plants=plants, node=node, out=out, commands=commands)

    yield begin
    end()


def told(out):
    """Return what a session left in a folder."""
    return json.loads((out / "experiment.json").read_text(encoding="utf-8"))


def is_playing(session):
    """Whether a run is in its middle."""
    return sum(m.effort[0] != 0.0 for m in session.commands) > 60


@pytest.fixture
def approved(session, ask, listener):
    """A function that returns an approved session at a condition, or at its end.

    Another one where a machine that stood still broke the run off.
    """

    def begin(condition, before=lambda asked: None, **values):
        for _ in range(4):
            asked = session(**values)
            before(asked)
            assert not asked.commands, asked.node.output
            assert ask("approve").success

            def again(asked=asked):  # a node that hears its bench late lets the approval expire
                if "approval has expired" in "".join(asked.node.output[-1:]):
                    listener.clients["/rsea/experiment/approve"].call_async(Trigger.Request())

            listener.until(lambda asked=asked: condition(asked) or not asked.node.is_running(), mend=again)
            if asked.node.is_running() or not any(stall in told(asked.out)["why"] for stall in STALLS):
                break
        return asked

    return begin


def test_an_approval_expires_without_a_bench_and_a_run_can_be_cancelled_at_any_sample(
    approved, ask, listener, start, bench
):
    """An approved run waited without limit, and began when a driver appeared. A broken one is not kept."""

    def expire(asked):
        asked.plants[-1].kill()
        assert ask("approve").success
        listener.until(lambda: any("approval has expired" in line for line in asked.node.output))
        asked.plants.append(start("plant", rig=bench / "bench.yaml"))
        states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
        listener.until(lambda: len(states) > 100)

    playing = approved(is_playing, expire, approval=0.6, longest=2.5, shortest=2.5)
    assert ask("cancel").success
    listener.until(lambda: not playing.node.is_running())
    assert playing.node.wait() == 0, playing.node.output
    efforts = np.array([m.effort[0] for m in playing.commands])
    ends = np.flatnonzero(efforts)[-1]
    assert np.all(np.abs(efforts) <= LIMIT) and len(efforts) - ends > 3
    last = np.abs(efforts[ends - 20 : ends + 1])
    assert np.all(np.diff(last) <= 0.0) and last[-1] < 0.05 * max(last[0], 0.1)  # softly
    said = told(playing.out)
    assert said["end"] == "broken" and "cancel" in said["why"] and said["seconds"] == 0.0
    assert not list(playing.out.glob("run-*"))


def test_a_folder_with_another_session_is_refused_before_a_run(bench, start, tmp_path):
    name = "run-2.mcap"
    (tmp_path / name).write_text("earlier", encoding="utf-8")
    values = {"causes": "current_loop_lag", "limits": f"torque={LIMIT}", "ask": False, "out": tmp_path}
    node = start("experiment", rig=RIG, bag=bench / "slow.mcap", **values)
    status, said = node.wait(), "\n".join(node.output)
    assert status == 2 and f"{name}: exists already" in said, said
    assert "proposed" not in said


def test_excite_plays_the_file_of_a_run(tmp_path):
    command = command_of(Shape("multisine", 4.0), 0.5, RATE)
    (tmp_path / "run.csv").write_text(run_text(command, RATE), encoding="utf-8")
    played, rate = plan({"file": str(tmp_path / "run.csv")})
    assert played == pytest.approx(command, abs=1e-8) and rate == pytest.approx(RATE)


def test_an_interrupt_in_the_middle_of_a_run_commands_zero_and_keeps_nothing(approved, listener):
    playing = approved(is_playing, longest=2.5, shortest=2.5)
    assert playing.node.stop() == 130, playing.node.output
    listener.until(lambda: playing.commands[-1].effort[0] == 0.0)
    assert not list(playing.out.glob("run-*.mcap"))


def test_a_driver_with_autostart_sees_a_rest_before_a_run(approved):
    """It latched `restarted` at the first torque, as it did for `excite`, and the session was over."""
    driven = {"device": "simulated", "autostart": True, "command_timeout": 1.0}
    first = approved(lambda asked: list(asked.out.glob("run-*")), driven=driven, longest=2.0)
    stamps = [stamp_of(message.header.stamp) for message in first.commands]
    assert list(first.out.glob("run-1.mcap")), told(first.out)
    assert first.commands[0].effort[0] == 0.0 and stamps[1] - stamps[0] > 1.0e9


def test_a_run_confirms_the_cause(approved):
    first = approved(lambda asked: False, longest=2.0)
    assert first.node.wait() == 0, first.node.output
    assert (first.out / "run-1.mcap").is_file()
    said = told(first.out)
    assert said["end"] == "confirmed", said["why"]
