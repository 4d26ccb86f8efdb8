"""Numbers of serialised messages, against the messages that rclpy makes of them."""

import math

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters.cdr import RawReader, RawWriter
from msg_adapters.ros import (
    JointState,
    efforts_message,
    joint_state_message,
    torque_command_message,
    wrench_message,
)
from msg_adapters.topic_map import JOINT_STATE, WRENCH
from rsea_ros.errors import ParameterError

STAMP = 1_700_000_000_123_456_789
STATE = RawReader(JOINT_STATE, [("position", 0), ("effort", 0)])


@pytest.mark.parametrize("joint", ["", "a", "knee", "a_longer_name"])
def test_a_state_is_read_whatever_its_joint_is_called(joint):
    raw = serialize_message(joint_state_message(STAMP, 0.25, 3.0, -7.5, joint))
    assert STATE.read(raw) == (STAMP, [0.25, -7.5])


def test_a_field_that_a_message_lacks_is_nan():
    stamp, (position, effort) = STATE.read(serialize_message(torque_command_message(STAMP, 4.0)))
    assert stamp == STAMP and math.isnan(position) and effort == 4.0


@pytest.mark.parametrize("frame", ["", "ft", "ft_sensor"])
def test_a_wrench_is_read_as_rclpy_reads_it(frame):
    message = wrench_message(STAMP, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), frame=frame)
    reader = RawReader(WRENCH, [("wrench", 5)])
    assert reader.read(serialize_message(message)) == (STAMP, [message.wrench.torque.z])


def test_several_joints_and_damaged_messages_are_refused():
    with pytest.raises(ParameterError, match=r"2 joints \(a, b\), expected one"):
        STATE.read(serialize_message(efforts_message(STAMP, {"a": 1.0, "b": 2.0})))
    raw = serialize_message(joint_state_message(STAMP, 0.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match="expected at least"):
        STATE.read(raw[:30])
    assert STATE.read(raw) == (STAMP, [0.0, 0.0])


def test_of_several_joints_the_numbers_of_the_named_one_are_read():
    raw = serialize_message(efforts_message(STAMP, {"hip": 1.0, "knee": 2.0}))
    for joint, torque in (("hip", 1.0), ("knee", 2.0)):
        assert RawReader(JOINT_STATE, [("effort", 0)], joint).read(raw) == (STAMP, [torque])
    position = RawReader(JOINT_STATE, [("position", 0)], "knee")
    assert math.isnan(position.read(raw)[1][0])
    with pytest.raises(ParameterError, match=r"2 joints \(hip, knee\), expected 'ankle' once"):
        RawReader(JOINT_STATE, [("effort", 0)], "ankle").read(raw)


def test_a_joint_that_a_message_names_twice_is_refused():
    raw = bytearray(serialize_message(efforts_message(STAMP, {"hip": 1.0, "hop": 2.0})))
    raw[raw.index(b"hop") + 1] = ord("i")
    with pytest.raises(ParameterError, match="expected 'hip' once"):
        RawReader(JOINT_STATE, [("effort", 0)], "hip").read(bytes(raw))


class Counted(bytes):
    """Bytes that count those cut out of them."""

    cut = 0

    def __getitem__(self, key):
        part = super().__getitem__(key)
        Counted.cut += len(part) if isinstance(part, bytes) else 0
        return part


@pytest.mark.parametrize(
    ("reader", "message"),
    [
        (RawReader(WRENCH, [("wrench", 5)]), wrench_message(STAMP, (1.0,) * 6, frame="f" * 3_000_000)),
        (STATE, joint_state_message(STAMP, 0.0, 0.0, 0.0, "j" * 3_000_000)),
        (STATE, efforts_message(STAMP, {f"joint {k}": 1.0 for k in range(10_000)})),
    ],
)
def test_a_text_of_megabytes_is_refused_unread(reader, message):
    """It took 2.4 s of the cycle that commands the torque."""
    raw = Counted(serialize_message(message))
    Counted.cut = 0
    with pytest.raises(ParameterError, match="bytes, expected at most 65536") as caught:
        reader.read(raw)
    assert Counted.cut == 0 and len(str(caught.value)) < 200


@pytest.mark.parametrize("names", [["hip"], []])
def test_more_numbers_than_joints_are_refused(names):
    """The first one was obeyed: 10 N m of a message that may mean 20."""
    raw = serialize_message(JointState(name=names, effort=[10.0, 20.0]))
    with pytest.raises(ParameterError, match="2 numbers of effort, expected at most one for each joint"):
        RawReader(JOINT_STATE, [("effort", 0)], "hip").read(raw)


def test_a_frame_is_neither_read_nor_compared():
    """A sender that puts a counter into the frame costs no walk of each message."""
    reader = RawReader(WRENCH, [("wrench", 5)])
    messages = [wrench_message(STAMP, (0.0,) * 5 + (k,), frame="f" * 60_000 + f"{k:04}") for k in range(9)]
    raw = [Counted(serialize_message(message)) for message in messages]
    reader.read(raw[0])
    Counted.cut = 0
    assert [reader.read(one)[1] for one in raw] == [[float(k)] for k in range(9)]
    assert Counted.cut < 9 * 20


def test_messages_that_are_written_are_read_by_rclpy():
    template = efforts_message(0, {"distal": 0.0, "proximal": 0.0})
    writer = RawWriter(serialize_message(template), JOINT_STATE, "effort")
    written = deserialize_message(writer.write(STAMP, (1.5, -2.5, 9.0)), JointState)
    assert written == efforts_message(STAMP, {"distal": 1.5, "proximal": -2.5})
