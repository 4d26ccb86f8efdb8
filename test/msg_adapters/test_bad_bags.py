"""Bags that are refused, each with one line that names file, topic, value and expectation."""

from __future__ import annotations

import numpy as np
import pytest
from foreign import EPOCH, joint_state, run_rows, write_foreign

from msg_adapters import TopicMap, read_record
from rsea_ros.errors import BagError, ParameterError


def _without(topic):
    return [row for row in run_rows(4) if row[0] != topic]


def _change(index, message):
    rows = run_rows(4)
    rows[index] = (rows[index][0], rows[index][1], message)
    return rows


def _wrong_type():
    at = EPOCH
    return [*_without("/rsea/ft"), ("/rsea/ft", at, joint_state(at, effort=[1.0]))]


STATE = joint_state(EPOCH + 3_572_428, position=[0.1], velocity=[np.nan], effort=[0.3])
COMMAND = joint_state(EPOCH + 3_571_428, effort=[np.nan])
REFUSED = {
    "no command": (
        _without("/rsea/torque_command"),
        r"no message on /rsea/torque_command; the bag holds /rsea/ft \(",
    ),
    "no measurement": (run_rows(4)[::3], "no message on /rsea/joint_states or /rsea/ft; the bag holds"),
    "wrong type": (
        _wrong_type(),
        "/rsea/ft is sensor_msgs/msg/JointState, expected geometry_msgs/msg/WrenchStamped",
    ),
    "empty bag": ([], "no message on /rsea/torque_command; the bag holds no topic at all"),
    "NaN": (
        _change(3, COMMAND),
        r"/rsea/torque_command effort\[1\] is nan at 1763000000.127028217 s, expected a finite",
    ),
    "two joints": (
        _change(1, joint_state(EPOCH, ["hip", "knee"], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0])),
        r"/rsea/joint_states: 3 joints \(joint, hip, knee\), expected one; name it with --joint",
    ),
    "joints without names": (
        _change(1, joint_state(EPOCH, [], [0.0, 1.0])),
        r"2 joints \(joint\), expected one",
    ),
    "empty command": (
        [(name, at, joint_state(at) if "command" in name else m) for name, at, m in run_rows(4)],
        "the command's messages hold no effort, expected the torque in N·m",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_bag_is_refused_in_one_line(tmp_path, case):
    rows, text = REFUSED[case]
    bag = write_foreign(tmp_path / "bag", rows)
    with pytest.raises(BagError, match=text) as caught:
        read_record(bag)
    assert str(caught.value).startswith(str(bag))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("case", ["no command", "no measurement", "NaN"])
def test_faults_are_returned_where_a_diagnosis_asks_for_them(tmp_path, case):
    rows, _ = REFUSED[case]
    record = read_record(write_foreign(tmp_path / "bag", rows), strict=False)
    for name, count in (
        ("ft", "/rsea/ft"),
        ("command", "/rsea/torque_command"),
        ("velocity", "/rsea/joint_states"),
    ):
        expected = sum(topic == count for topic, _, _ in rows)
        assert len(record[name]) == expected if expected else name not in record
    if case == "NaN":
        assert np.isnan(record["command"].y[1])


@pytest.mark.parametrize("strict", [True, False])
def test_a_measurement_that_is_nan_stays_for_the_checks_to_mask(tmp_path, strict):
    record = read_record(write_foreign(tmp_path / "bag", _change(4, STATE)), strict=strict)
    assert np.isnan(record["velocity"].y).tolist() == [False, True, False, False]


def test_repeated_stamps_are_dropped_with_a_note_or_kept(tmp_path):
    bag = write_foreign(tmp_path / "bag", [*run_rows(4), *run_rows(4)[-1:]])
    record = read_record(bag)
    assert len(record["ft"]) == 4
    assert [(f.kind, f.channel) for f in record.faults] == [("duplicate_stamps", "ft")]
    assert record.notes == (f"{bag}: /rsea/ft wrench: 1 of 5 stamps repeat, the first of each kept",)
    assert len(read_record(bag, strict=False)["ft"]) == 5


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.mcap", b"", "empty file"),
        ("a.mcap", b"nothing of the kind", "no MCAP file, expected it to start with"),
        (
            "a.mcap",
            b"\x89MCAP0\r\n",
            r"no message on /rsea/torque_command; the bag holds no topic at all \(.*cut off",
        ),
        ("a.db3", b"nothing of the kind", "no sqlite3 file"),
        ("a.db3", b"SQLite format 3\x00" + bytes(200), "no rosbag2 database"),
        ("a.csv", b"1,2", "no bag, expected a directory, or a .mcap, .db3 or .bag file"),
        ("a.mcap.zstd", b"nothing of the kind", "Unable to decompress|Unknown frame|decompress"),
    ],
)
def test_files_that_are_not_bags_are_refused(tmp_path, name, content, text):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(BagError, match=text) as caught:
        read_record(file)
    assert str(caught.value).startswith(str(file))


def test_directories_that_are_not_bags_are_refused(tmp_path):
    with pytest.raises(BagError, match="no bag, expected a directory with"):
        read_record(tmp_path)
    with pytest.raises(BagError, match="no such bag"):
        read_record(tmp_path / "nothing")
    bag = write_foreign(tmp_path / "bag", run_rows(4))
    (bag / "bag.mcap").rename(bag / "other.mcap")
    with pytest.raises(BagError, match=r"metadata.yaml: names bag.mcap, which is not there"):
        read_record(bag)


def test_senseless_topic_options_are_refused():
    with pytest.raises(ParameterError, match="axis 'yaw': expected one of"):
        TopicMap(axis="yaw")
    with pytest.raises(
        ParameterError, match="topic 'wrench=/ft': expected ROLE=TOPIC with ROLE one of torque_command"
    ):
        TopicMap().with_topics(["wrench=/ft"])
