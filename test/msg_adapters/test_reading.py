"""Bags of all kinds, of ROS 1 and of other types too, written by rosbags, come out as the same record."""

import numpy as np
import pytest
from foreign import (
    EPOCH,
    STORE,
    Packing,
    header,
    joint_state,
    make,
    numbers,
    run_rows,
    wrench,
    write_foreign,
    write_ros1,
)
from mcap_bytes import McapFile, write
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import get_types_from_msg

from msg_adapters import TopicMap, iterate, read_record
from rsea_ros.errors import BagError

MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
COUNT = 50


def assert_is_the_run(record, count=COUNT):
    k = np.arange(count)
    expected = {"command": 0.5, "position": 0.1, "velocity": 0.2, "motor_torque": 0.3, "ft": 0.7}
    offsets = {"command": 0, "ft": 2000}
    assert set(record.channels) == set(expected)
    assert record.epoch_ns == EPOCH
    for name, factor in expected.items():
        assert np.array_equal(record[name].y, k * factor), name
        assert np.array_equal(record[name].t, (k * 3_571_428 + offsets.get(name, 1000)) * 1e-9), name


@pytest.mark.parametrize(
    ("storage", "compression"),
    [
        (MCAP, CompressionMode.NONE),
        (MCAP, CompressionMode.STORAGE),
        (MCAP, CompressionMode.MESSAGE),
        (MCAP, CompressionMode.FILE),
        (SQLITE, CompressionMode.NONE),
        (SQLITE, CompressionMode.MESSAGE),
        (SQLITE, CompressionMode.FILE),
    ],
)
def test_every_storage_and_compression_gives_the_same_record(tmp_path, storage, compression):
    bag = write_foreign(tmp_path / "bag", run_rows(COUNT), storage, compression)
    assert_is_the_run(read_record(bag))
    file = next(path for path in bag.iterdir() if path.name != "metadata.yaml")
    assert_is_the_run(read_record(file))
    (bag / "metadata.yaml").unlink()
    bare = read_record(bag)
    assert_is_the_run(bare)
    assert "without metadata.yaml" in bare.notes[0]


def test_lz4_chunks_are_read(tmp_path):
    assert_is_the_run(read_record(write(tmp_path / "a.mcap", McapFile(run_rows(COUNT), how="lz4").file())))


def test_other_topic_names_and_unrelated_topics_are_read(tmp_path):
    rows = run_rows(COUNT, "/lab/knee")
    rows = [(name.replace("/lab/knee/ft", "/wrist/wrench"), at, message) for name, at, message in rows]
    rows += [("/rosout_like", EPOCH, make("std_msgs/msg/String", data="hello"))]
    rows += [("/lab/knee/pure_torque", EPOCH, make("std_msgs/msg/Bool", data=True))]
    bag = write_foreign(tmp_path / "bag", rows)
    topics = TopicMap(namespace="lab/knee").with_topics(["ft=/wrist/wrench"])
    assert_is_the_run(read_record(bag, topics=topics))


@pytest.mark.parametrize("strict", [True, False])
def test_a_topic_that_was_named_must_be_in_the_bag(tmp_path, strict):
    """Without it a record without F/T torque was identified, and nobody was told."""
    bag = write_foreign(tmp_path / "bag", run_rows(COUNT))
    with pytest.raises(BagError, match=r"no topic /rsea/fft for ft, did you mean /rsea/ft\?; the bag holds"):
        read_record(bag, topics=TopicMap().with_topics(["ft=fft"]), strict=strict)


def test_split_bags_and_several_files_are_one_run(tmp_path):
    rows = run_rows(COUNT)
    first = write_foreign(tmp_path / "first", rows[:60])
    second = write_foreign(tmp_path / "second", rows[60:], SQLITE)
    assert_is_the_run(read_record([first, second]))


def test_the_requested_joint_and_axis_are_read(tmp_path):
    rows = []
    for k in range(5):
        at = EPOCH + k
        names = ["hip", "knee"] if k % 2 else ["knee", "hip"]
        values = [-1.0, float(k)] if k % 2 else [float(k), -1.0]
        rows.append(("/rsea/torque_command", at, joint_state(at, ["knee"], effort=[2.0 * k])))
        rows.append(("/rsea/joint_states", at, joint_state(at, names, values, values, values)))
        rows.append(("/rsea/joint_states", at, joint_state(at, ["wheel"], [9.0], [9.0], [9.0])))
        rows.append(("/rsea/ft", at, wrench(at, [0.0, 7.0 * k, 0.0, 0.0, 0.0, 0.0])))
    record = read_record(
        write_foreign(tmp_path / "bag", rows), topics=TopicMap(joint="knee", axis="-force.y")
    )
    assert record["position"].y.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert record["command"].y.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert record["ft"].y.tolist() == [0.0, -7.0, -14.0, -21.0, -28.0]


def test_a_zero_stamp_is_replaced_by_the_log_time_and_reported(tmp_path):
    rows = run_rows(4)
    rows[2] = ("/rsea/ft", EPOCH + 2000, wrench(0, [0.0] * 6))
    record = read_record(write_foreign(tmp_path / "bag", rows))
    assert record["ft"].t[0] == 2000 * 1e-9
    assert record.notes == (f"{tmp_path}/bag: /rsea/ft: 1 of 4 header stamps are zero, log time taken",)


def test_fields_that_nobody_measures_are_no_channels(tmp_path):
    """A joint state broadcaster fills missing fields with NaN, others leave the array empty."""
    rows = run_rows(4)
    for k in range(4):
        _, at, message = rows[3 * k + 1]
        message.effort[:] = np.nan
        message.velocity = np.array([])
        rows[3 * k + 1] = ("/rsea/joint_states", at, message)
    record = read_record(write_foreign(tmp_path / "bag", rows))
    assert set(record.channels) == {"command", "position", "ft"}
    assert "effort: not a number in every message" in record.notes[0]


def test_the_reference_of_a_closed_loop_is_read(tmp_path):
    rows = run_rows(4)
    targets = {"position": [1.25], "velocity": [0.5]}
    rows += [("/rsea/desired_position", at, joint_state(at, **targets)) for _, at, _ in rows[::3]]
    got = read_record(write_foreign(tmp_path / "bag", rows))
    assert got["reference"].y.tolist() == [1.25] * 4
    assert got["reference_velocity"].y.tolist() == [0.5] * 4


def test_a_target_that_is_a_number_alone_is_an_angle(tmp_path):
    rows = run_rows(4)
    number = make("std_msgs/msg/Float64", data=1.25)
    rows += [("/rsea/desired_position", at, number) for _, at, _ in rows[::3]]
    got = read_record(write_foreign(tmp_path / "bag", rows))
    assert "reference" in got and "reference_velocity" not in got


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_all_messages_come_by_log_time_untouched(tmp_path, storage):
    rows = [*run_rows(6), ("/else", EPOCH + 5, make("std_msgs/msg/String", data="hello"))]
    bag = write_foreign(tmp_path / "bag", rows[::-1], storage)
    got = list(iterate(bag))
    expected = sorted((at, name, message.__msgtype__) for name, at, message in rows)
    assert [(at, name, kind) for name, kind, at, _ in got] == expected
    assert next(raw for name, _, _, raw in got if name == "/else").endswith(b"hello\0")


STORE.register(
    get_types_from_msg("string[] interface_names\nfloat64[] values", "control_msgs/msg/InterfaceValue")
)
STORE.register(
    get_types_from_msg(
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values",
        "control_msgs/msg/DynamicJointState",
    )
)
COMMANDS = "/effort_controller/commands"


def read(folder, command, states=None, command_topic=COMMANDS, joint=None):
    """Return the record of a run whose commands, and states, are other messages. command, states: of k."""
    rows = []
    for topic, at, message in run_rows(COUNT):
        k = round((at - EPOCH) / 3_571_428)
        if topic.endswith("torque_command"):
            rows.append((COMMANDS, at, command(k)))
        elif topic.endswith("joint_states") and states is not None:
            rows.append((topic, at, states(k, at)))
        else:
            rows.append((topic, at, message))
    topics = TopicMap(joint=joint).with_topics([f"torque_command={command_topic}"])
    return read_record(write_foreign(folder / "bag", rows), topics=topics)


def dynamic(k, at):
    """The joint beside another one, which has other interfaces."""
    names = [["position", "temperature"], ["torque_sensor", "velocity", "effort", "position"]]
    values = [[9.0, 40.0], [8.0, k * 0.2, k * 0.3, k * 0.1]]
    parts = [
        make("control_msgs/msg/InterfaceValue", interface_names=n, values=np.array(v))
        for n, v in zip(names, values, strict=True)
    ]
    return make(
        "control_msgs/msg/DynamicJointState",
        header=header(at), joint_names=["other", "elbow"], interface_values=parts,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("command", "topic", "note"),
    [
        (lambda k: make("std_msgs/msg/Float64", data=k * 0.5), COMMANDS, "have no stamps"),
        (lambda k: numbers(k * 0.5), COMMANDS, "have no stamps"),
        (lambda k: numbers(0.0, 0.0, k * 0.5), COMMANDS, "[2] taken, the only one of 3"),
        (lambda k: numbers(k, k * 0.5), f"{COMMANDS}[1]", "have no stamps"),
    ],
)
def test_commands_of_a_forward_controller_are_read_by_their_log_times(command, topic, note, tmp_path):
    record = read(tmp_path, command, command_topic=topic)
    assert record["command"].y.tolist() == [k * 0.5 for k in range(COUNT)]
    assert np.allclose(record["command"].t, np.arange(COUNT) * 3_571_428e-9, atol=1e-9)
    assert any(note in line for line in record.notes)
    assert not record.faults


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        (COMMANDS, r"2 numbers without names, expected which: --topic torque_command=/ef.*\[0\] to \[1\]"),
        (f"{COMMANDS}[2]", "2 numbers without names, expected more than 2"),
    ],
)
def test_several_numbers_need_one_that_is_named(topic, message, tmp_path):
    with pytest.raises(BagError, match=message):
        read(tmp_path, lambda k: numbers(k, k * 0.5), command_topic=topic)


def test_a_dynamic_joint_state_is_read_by_its_interfaces(tmp_path):
    record = read(tmp_path, lambda k: numbers(k * 0.5), dynamic, joint="elbow")
    for name, factor in {"position": 0.1, "velocity": 0.2, "motor_torque": 0.3}.items():
        assert np.array_equal(record[name].y, np.arange(COUNT) * factor), name


@pytest.mark.parametrize(
    ("joint", "message"), [(None, "2 joints .other, elbow., expected one"), ("knee", "no joint 'knee'")]
)
def test_one_joint_of_a_dynamic_joint_state_is_named(joint, message, tmp_path):
    with pytest.raises(BagError, match=message):
        read(tmp_path, lambda k: numbers(k * 0.5), dynamic, joint=joint)


PACKED = [None, *Packing]


@pytest.mark.parametrize("compression", PACKED)
def test_a_bag_of_ros_1_is_the_same_record(compression, tmp_path):
    rows = run_rows()
    old = read_record(write_ros1(tmp_path / "run.bag", rows, compression))
    new = read_record(write_foreign(tmp_path / "bag", rows))
    assert old.epoch_ns == new.epoch_ns
    for name, channel in new.channels.items():
        assert np.array_equal(old[name].t, channel.t), name
        assert np.array_equal(old[name].y, channel.y), name
    assert not old.faults


def test_a_damaged_chunk_ends_the_bag_and_is_counted(tmp_path):
    file = write_ros1(tmp_path / "run.bag", run_rows(500), Packing.BZ2)
    data = bytearray(file.read_bytes())
    second = data.index(b"BZh", data.index(b"BZh") + 3)
    data[second + 20 : second + 60] = bytes(40)
    file.write_bytes(data)
    record = read_record(file)
    fault = next(f for f in record.faults if f.kind == "cut_off")
    assert 0 < fault.share < 1
    assert fault.size == 1500 - sum(len(record[name]) for name in ("command", "position", "ft"))


def test_a_damaged_byte_anywhere_is_refused_or_read(tmp_path):
    whole = write_ros1(tmp_path / "run.bag", run_rows(5)).read_bytes()
    file = tmp_path / "damaged.bag"
    for at in range(0, len(whole), 101):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            read_record(file)
        except BagError as error:
            assert "\n" not in str(error)


def test_a_bag_that_was_never_closed_names_the_remedy(tmp_path):
    file = write_ros1(tmp_path / "run.bag", run_rows(5))
    data = file.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    file.write_bytes(data[:at] + bytes(8) + data[at + 8 :])
    with pytest.raises(BagError, match=r"not indexed, .*; rosbag reindex mends"):
        read_record(file)


def test_other_topics_are_passed_by(tmp_path):
    rows = [*run_rows(5), ("/chatter", run_rows(5)[-1][1], make("std_msgs/msg/String", data="hello"))]
    assert len(list(iterate(write_ros1(tmp_path / "run.bag", rows)))) == 16
