"""The decoder and the encoder of messages against independent ones: rosbags and Fast CDR (rclpy)."""

import math
import subprocess
import sys

import numpy as np
import pytest
from foreign import JOINT_STATE, STORE, WRENCH, joint_state, raw_of, wrench
from hypothesis import given, settings, strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters import cdr, ros
from msg_adapters.cdr import RawReader, RawWriter, blocks
from msg_adapters.ros import (
    JointState,
    efforts_message,
    joint_state_message,
    torque_command_message,
    wrench_message,
)
from rsea_ros.errors import BagError, ParameterError

values = st.floats(allow_nan=False, width=64)
arrays = st.lists(values, max_size=3)
stamps = st.integers(0, 2**31 * 10**9 - 1)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
joint_states = st.builds(joint_state, stamps, st.lists(texts, max_size=3), arrays, arrays, arrays, texts)
wrenches = st.builds(wrench, stamps, st.lists(values, min_size=6, max_size=6), texts)


def _stamp(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@settings(max_examples=20)
@given(st.lists(joint_states, min_size=1, max_size=12))
def test_joint_states_of_any_layout_decode_as_rosbags_does(messages):
    raw = [raw_of(message) for message in messages]
    seen = []
    for block in blocks(raw, JOINT_STATE, "here"):
        fields = {name: block.field(name) for name in ("position", "velocity", "effort")}
        for at, (row, stamp) in enumerate(zip(block.rows, block.stamps(), strict=True)):
            message = STORE.deserialize_cdr(raw[row], JOINT_STATE)
            assert stamp == _stamp(message)
            assert list(block.layout.names) == message.name
            for name, matrix in fields.items():
                assert np.array_equal(matrix[at], getattr(message, name))
            seen.append(row)
    assert sorted(seen) == list(range(len(raw)))


@given(st.lists(wrenches, min_size=1, max_size=8))
def test_wrenches_decode_as_rosbags_does(messages):
    raw = [raw_of(message) for message in messages]
    for block in blocks(raw, WRENCH, "here"):
        for row, stamp, got in zip(block.rows, block.stamps(), block.field("wrench"), strict=True):
            whole = STORE.deserialize_cdr(raw[row], WRENCH)
            force, torque = whole.wrench.force, whole.wrench.torque
            assert stamp == _stamp(whole)
            assert got.tolist() == [force.x, force.y, force.z, torque.x, torque.y, torque.z]


@pytest.mark.parametrize("little_endian", [True, False])
def test_both_byte_orders_are_decoded(little_endian):
    message = joint_state(5_000_000_007, ["a"], [1.5], [], [-2.5], "frame")
    (block,) = blocks(
        [bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little_endian))], JOINT_STATE, "here"
    )
    assert block.stamps() == 5_000_000_007
    assert block.field("position") == 1.5
    assert block.field("effort") == -2.5


@pytest.mark.parametrize("name", ["joint", "j", "a longer name of a joint"])
def test_encoded_bytes_equal_those_of_rosbags(name):
    at = np.array([1, 1_763_000_000_999_999_999])
    position, effort = np.array([0.5, -1.5]), np.array([2.0, 3.0])
    expected = [
        joint_state(int(s), [name], [p], [], [e]) for s, p, e in zip(at, position, effort, strict=True)
    ]
    got = cdr.joint_states(at, name, position=position, effort=effort)
    assert got == [raw_of(message) for message in expected]
    six = np.arange(12.0).reshape(2, 6)
    expected = [wrench(int(s), row.tolist(), "ft_sensor") for s, row in zip(at, six, strict=True)]
    assert cdr.wrenches(at, six) == [raw_of(message) for message in expected]


def test_rubbish_in_the_padding_does_not_change_the_layout():
    """Fast CDR leaves whatever was in its buffer between the numbers, and behind the last one."""
    clean = raw_of(joint_state(7, ["joint"], [1.0], [2.0], [3.0]))
    dirty = bytearray(clean)
    for at in (17, 18, 19, 34, 35):  # behind the empty frame and behind "joint\0"
        assert dirty[at] == 0
        dirty[at] = 0xAB
    (block,) = blocks([clean, bytes(dirty)], JOINT_STATE, "here")
    assert block.field("effort").tolist() == [[3.0], [3.0]]
    (block,) = blocks([clean + b"\xfe" * 8], JOINT_STATE, "here")
    assert block.field("velocity").tolist() == [[2.0]]


@given(joint_states, st.data())
def test_a_message_that_breaks_off_is_refused_by_name(message, data):
    raw = raw_of(message)
    end = max([28, *(28 for _ in message.name)])
    cut = data.draw(st.integers(0, min(end, len(raw)) - 5))
    with pytest.raises(BagError, match="here: message 0 is no sensor_msgs/msg/JointState"):
        list(blocks([raw[:cut]], JOINT_STATE, "here"))


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


WHEN = 1_763_000_000_123_456_789


def test_types_are_found_by_name():
    assert ros.message_type(JOINT_STATE) is ros.JointState
    with pytest.raises(ParameterError, match="message type 'own_msgs/msg/Thing' is not installed"):
        ros.message_type("own_msgs/msg/Thing")


def test_our_bytes_are_understood_by_fast_cdr():
    (raw,) = cdr.joint_states(np.array([WHEN]), "knee", effort=np.array([-3.5]))
    state = deserialize_message(raw, ros.JointState)
    assert (ros.stamp_of(state.header.stamp), state.name, *state.effort) == (WHEN, ["knee"], -3.5)
    (raw,) = cdr.wrenches(np.array([WHEN]), np.arange(6.0)[None, :])
    wrench = deserialize_message(raw, ros.WrenchStamped)
    assert (ros.stamp_of(wrench.header.stamp), wrench.wrench.torque.x) == (WHEN, 3.0)


def test_bags_need_no_ros():
    program = (
        "import sys, msg_adapters, msg_adapters.records, msg_adapters.tables\n"
        "print([name for name in sys.modules if name.endswith('_msgs') or name == 'rclpy'])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
