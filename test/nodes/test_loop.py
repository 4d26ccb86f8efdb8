"""excite, plant, record, replay, identify: nothing is lost, and the bag says what happened."""

import signal

import numpy as np
import pytest

from msg_adapters import iterate, read_record
from msg_adapters.ros import Clock, JointState, WrenchStamped, stamp_of
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.nodes._qos import COMMAND, RECORD_RELIABLE

RIG = "paper_high_impedance"
DURATION = 4.0
ATTEMPTS = 4
TOPICS = ("/rsea/torque_command", "/rsea/joint_states", "/rsea/ft")


@pytest.fixture(scope="module")
def bag(start, tmp_path_factory):
    """A bag of a run without late commands and gaps: a machine that stalls for long makes some.

    excite and plant count them themselves; what they do not count is for the tests to find.
    """
    for attempt in range(ATTEMPTS):
        path = tmp_path_factory.mktemp("loop") / f"bag{attempt}"
        excite, plant = run(start, path)
        if not any("WARN" in line for line in plant) and ", 0 left out" in excite[-1]:
            return path
    raise AssertionError(f"{ATTEMPTS} runs, and in each the machine stalled: {plant[-1]}, {excite[-1]}")


def run(start, path):
    """Record excite and plant into a bag, stopped by SIGINT; return what the two have said."""
    plant = start("plant", rig=RIG, seed=3)
    record = start("record", out=path)
    excite = start("excite", duration=DURATION, subscribers=2, seed=7, lead=0.2)
    assert excite.wait() == 0, excite.output
    assert record.stop() == 0, record.output
    assert plant.stop() == 0, plant.output
    return excite.output, plant.output


@pytest.fixture(scope="module")
def recorded(bag):
    """The bag as a record."""
    return read_record(bag)


def test_the_bag_has_every_command_that_was_planned(recorded):
    planned = excitation("chirp", ExcitationSettings(duration=DURATION, seed=7), 0.5)
    command = recorded["command"]
    assert np.array_equal(command.y[: len(planned)], planned)
    assert np.all(command.y[len(planned) :] == 0.0) and len(command) > len(planned)
    assert np.diff(command.t) == pytest.approx(1.0 / 280.0, abs=2e-9)


def test_the_bag_has_every_measurement(recorded):
    for name in ("position", "ft"):
        assert np.diff(recorded[name].t) == pytest.approx(1.0 / 280.0, abs=2e-9)
    assert recorded["ft"].t[-1] > recorded["command"].t[int(DURATION * 280)]


def test_commands_take_effect_at_cycle_starts(recorded):
    phase = (recorded["command"].t - recorded["position"].t[0]) * 280.0
    assert phase == pytest.approx(np.round(phase), abs=1e-5)


def test_the_bag_says_what_the_plant_did(recorded):
    """The true rig driven by the bag's commands at their stamps leaves the sensors' noise, nothing else."""
    rig = load_rig(RIG)
    simulated = simulate(rig, recorded)
    driven = {n: recorded[n].t > recorded["command"].t[0] for n in simulated}
    for name in ("ft", "position"):
        sensor = rig.sensors[name]
        error = (recorded[name].y - simulated[name])[driven[name]]
        expected = np.hypot(sensor.noise, sensor.quantum / np.sqrt(12.0))
        assert np.sqrt(np.mean(error**2)) == pytest.approx(expected, rel=0.1)


def test_replay_keeps_stamps_and_gives_identify_everything(bag, start, listener, tmp_path):
    clock = listener.hear(Clock, "/clock", COMMAND)
    states, *_ = (
        listener.hear(kind, topic, RECORD_RELIABLE)
        for topic, kind in (
            ("/rsea/joint_states", JointState),
            ("/rsea/torque_command", JointState),
            ("/rsea/ft", WrenchStamped),
        )
    )
    identify = start("identify", rig=RIG, out=tmp_path, reliable=True)
    replay = start("replay", bag=bag, rate=10.0, subscribers=2)
    epoch = read_record(bag).epoch_ns
    expected = epoch + np.rint(read_record(bag)["position"].t * 1e9).astype(np.int64)
    listener.until(lambda: not replay.is_running() and len(states) >= len(expected))
    listener.forget()
    assert replay.wait() == 0, replay.output
    rows = [row for row in iterate(bag) if row[0] in TOPICS]
    stamps = [stamp_of(m.header.stamp) for m in states]
    assert stamps == expected.tolist()
    ticks = np.array([stamp_of(m.clock) for m in clock])
    assert np.all(np.diff(ticks) > 0) and rows[0][2] <= ticks[0] and ticks[-1] <= rows[-1][2]
    assert identify.wait() == 0, identify.output
    gathered = next(line for line in identify.output if "identifying from" in line)
    for topic in TOPICS:
        assert f"{sum(row[0] == topic for row in rows)} {topic.rpartition('/')[2]}" in gathered
    identified = load_rig(tmp_path / "model.yaml")
    for name in load_rig(RIG).free():
        low, high = identified.quantities[name].ci95
        assert abs(identified[name] - load_rig(RIG)[name]) < high - low


def test_excite_interrupted_ends_with_zero_and_says_so(start, listener):
    commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)
    plant = start("plant", rig=RIG)
    excite = start("excite", duration=100.0, kind="white_noise", amplitude=5.0, ramp=0.0)
    listener.until(lambda: sum(m.effort[0] != 0.0 for m in commands) > 50)
    assert excite.stop(signal.SIGINT) == 130
    listener.until(lambda: len(commands) > 50 and commands[-1].effort[0] == 0.0)
    assert "torque zero" in excite.output[-1]
    assert plant.stop() == 0


def test_record_ends_by_itself_after_its_duration(start, tmp_path):
    plant = start("plant", rig=RIG)
    record = start("record", out=tmp_path / "bag", duration=1.0, storage="sqlite3")
    assert record.wait() == 0, record.output
    assert plant.stop() == 0
    assert sum(row[0] == "/rsea/ft" for row in iterate(tmp_path / "bag")) > 10
