"""The decoder and the encoder against two independent ones: rosbags and Fast CDR (rclpy)."""

from __future__ import annotations

import numpy as np
import pytest
from foreign import JOINT_STATE, STORE, WRENCH, joint_state, raw_of, wrench
from hypothesis import given, settings, strategies as st

from msg_adapters import cdr
from msg_adapters.cdr import blocks
from rsea_ros.errors import BagError

values = st.floats(allow_nan=False, width=64)
arrays = st.lists(values, max_size=3)
stamps = st.integers(0, 2**31 * 10**9 - 1)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
joint_states = st.builds(joint_state, stamps, st.lists(texts, max_size=3), arrays, arrays, arrays, texts)
wrenches = st.builds(wrench, stamps, st.lists(values, min_size=6, max_size=6), texts)


def _stamp(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@settings(max_examples=40)
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
