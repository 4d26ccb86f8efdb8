"""Numbers of serialised messages, against the messages that rclpy makes of them."""

import math

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters.raw import RawReader, RawWriter
from msg_adapters.ros import (
    JointState,
    efforts_message,
    joint_state_message,
    torque_command_message,
    wrench_message,
    wrench_of,
)
from msg_adapters.topics import JOINT_STATE, WRENCH
from rsea_ros.errors import ParameterError

STAMP = 1_700_000_000_123_456_789
STATE = RawReader(JOINT_STATE, [("position", 0), ("effort", 0)])


@pytest.mark.parametrize("joint", ["", "a", "knee", "a_longer_name"])
def test_a_state_is_read_whatever_its_joint_is_called(joint):
    raw = serialize_message(joint_state_message(STAMP, 0.25, 3.0, -7.5, joint))
    assert STATE.read(raw) == (STAMP, [0.25, -7.5])


def test_what_a_message_does_not_have_is_nan():
    stamp, (position, effort) = STATE.read(serialize_message(torque_command_message(STAMP, 4.0)))
    assert stamp == STAMP and math.isnan(position) and effort == 4.0


@pytest.mark.parametrize("frame", ["", "ft", "ft_sensor"])
def test_a_wrench_is_read_as_rclpy_reads_it(frame):
    message = wrench_message(STAMP, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), frame=frame)
    reader = RawReader(WRENCH, [("wrench", 5)])
    assert reader.read(serialize_message(message)) == (STAMP, [wrench_of(message)[1]])


def test_several_joints_and_damaged_messages_are_refused():
    with pytest.raises(ParameterError, match=r"2 joints \(a, b\), expected one"):
        STATE.read(serialize_message(efforts_message(STAMP, {"a": 1.0, "b": 2.0})))
    raw = serialize_message(joint_state_message(STAMP, 0.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match="expected at least"):
        STATE.read(raw[:30])
    assert STATE.read(raw) == (STAMP, [0.0, 0.0])


def test_what_is_written_is_read_by_rclpy():
    template = efforts_message(0, {"distal": 0.0, "proximal": 0.0})
    writer = RawWriter(serialize_message(template), JOINT_STATE, "effort")
    written = deserialize_message(writer.write(STAMP, (1.5, -2.5, 9.0)), JointState)
    assert written == efforts_message(STAMP, {"distal": 1.5, "proximal": -2.5})
