"""excite, record, replay, identify: nothing is lost, and every end is at zero."""

import signal
from dataclasses import replace

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from msg_adapters import BagWriter, iterate, read_record, write_record
from msg_adapters.ros import (
    Clock,
    JointState,
    WrenchStamped,
    stamp_of,
    state_message,
    torque_command_message,
    wrench_message,
)
from msg_adapters.topic_map import FIELDS, ROLES, TYPES
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.nodes import record
from rsea_ros.nodes._bench_topics import SPRING_FRAME
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, RECORD_RELIABLE
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"
ATTEMPTS = 4
TOPICS = ("/rsea/torque_command", "/rsea/joint_states", "/rsea/ft")


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag as a recording of excite and plant leaves it (the real one is read in test/cli/test_demo.py)."""
    path = tmp_path_factory.mktemp("loop") / "bag"
    command = excitation("chirp", ExcitationSettings(duration=4.0, seed=7))
    made = synthesize(load_rig(RIG), Channel(np.arange(len(command)) / 280.0, command), seed=3)
    write_record(replace(made, epoch_ns=1_700_000_000_000_000_000), path)
    return path


def test_replay_keeps_stamps_and_gives_identify_everything(bag, start, listener, tmp_path):
    clock = listener.hear(Clock, "/clock", MEASUREMENT)
    states = listener.hear(JointState, "/rsea/joint_states", RECORD_RELIABLE)
    listener.hear(JointState, "/rsea/torque_command", RECORD_RELIABLE)
    identify = start("identify", rig=RIG, out=tmp_path, reliable=True, quiet=1.0)
    replay = start("replay", bag=bag, rate=10.0, subscribers=2)
    listener.until(lambda: listener.node.count_publishers("/clock"))  # of which nobody sends ticks again
    listener.hear(WrenchStamped, "/rsea/ft", RECORD_RELIABLE)  # the last that it waits for
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


def test_excite_interrupted_ends_with_zero_and_a_recording_by_itself_after_its_duration(
    start, listener, tmp_path
):
    commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)
    states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
    plant = start("plant", rig=RIG)
    listener.until(lambda: states)
    record = start("record", out=tmp_path / "bag", duration=1.0, storage="sqlite3")
    excite = start("excite", duration=100.0, kind="white_noise", amplitude=5.0, ramp=0.0)
    listener.until(lambda: sum(m.effort[0] != 0.0 for m in commands) > 50)
    assert excite.stop(signal.SIGINT) == 130
    listener.until(lambda: len(commands) > 50 and commands[-1].effort[0] == 0.0)
    assert "torque zero" in excite.output[-1]
    assert record.wait() == 0, record.output
    assert plant.stop() == 0
    assert sum(row[0] == "/rsea/ft" for row in iterate(tmp_path / "bag")) > 10


def test_a_signal_completes_the_bag_of_a_recording(start, listener, tmp_path):
    record = start("record", out=tmp_path / "bag")
    listener.until(lambda: any("recording into" in line for line in record.output))
    assert record.stop(signal.SIGHUP) == 0, record.output
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]
    assert {topic for topic, *_ in iterate(tmp_path / "bag")} <= {"/diagnostics"}  # its own, of each second


def test_a_recording_that_exists_is_refused(start, tmp_path):
    with BagWriter(tmp_path / "bag.mcap") as bag:
        bag.write("/a", "std_msgs/msg/Bool", 5, bytes([0, 1, 0, 0, 1]))
    record = start("record", out=tmp_path / "bag.mcap")
    assert record.wait() == 2
    assert len(record.output) == 1 and "exists already, expected a new name" in record.output[0]
    assert len(list(iterate(tmp_path / "bag.mcap"))) == 1




START = 1_700_000_000 * 10**9


@pytest.mark.parametrize(("frame", "kept"), [(SPRING_FRAME.default, False), ("ft_sensor", True)])
def test_a_bag_has_the_deflection_and_only_a_sensors_torque(tmp_path, frame, kept):
    angles = 0.01 * np.sin(np.arange(50) / 5.0)
    with BagWriter(tmp_path / "run.mcap") as bag:
        for k, angle in enumerate(angles):
            stamp = START + k * 3_571_429
            for topic, message in (
                ("torque_command", torque_command_message(stamp, 10.0 * angle)),
                ("deflection", state_message(stamp, ["joint"], SPRING_FRAME.default, position=[angle])),
                ("ft", wrench_message(stamp, (0.0,) * 5 + (1500.0 * angle,), frame=frame)),
            ):
                bag.write(f"/rsea/{topic}", TYPES[topic], stamp, bytes(serialize_message(message)))
    run = read_record(tmp_path / "run.mcap")
    assert run["deflection"].y == pytest.approx(angles, abs=1e-12)
    assert ("ft" in run) is kept
    told = [note for note in run.notes if "no sensor's, the stiffness of a rig times" in note]
    assert bool(told) is not kept


def test_everything_that_a_record_is_made_of_is_recorded():
    assert set(ROLES) == set(FIELDS) <= set(record.TOPICS)
