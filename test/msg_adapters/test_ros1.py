"""Bags of ROS 1, written by rosbags, come out as the record that ROS 2 gives."""

from __future__ import annotations

import numpy as np
import pytest
from foreign import Packing, make, run_rows, write_foreign, write_ros1

from msg_adapters import iterate, read_record
from rsea_ros.errors import BagError

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
