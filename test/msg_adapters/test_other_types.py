"""Numbers without names and stamps, and DynamicJointState, in place of JointState."""

from __future__ import annotations

import numpy as np
import pytest
from foreign import EPOCH, STORE, header, make, numbers, run_rows, write_foreign
from rosbags.typesys import get_types_from_msg

from msg_adapters import TopicMap, read_record
from rsea_ros.errors import BagError

STORE.register(
    get_types_from_msg("string[] interface_names\nfloat64[] values", "control_msgs/msg/InterfaceValue")
)
STORE.register(
    get_types_from_msg(
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values",
        "control_msgs/msg/DynamicJointState",
    )
)
COUNT = 50
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
