"""Damaged messages and rows are left out and reported with counts."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from foreign import raw_of, run_rows, spoilt_database, write_foreign
from mcap_bytes import McapFile, write

from msg_adapters import read_record
from rsea_ros.errors import BagError

COUNT = 60


def _read(tmp_path, spoil, topic, strict):
    """Read a file in which every tenth message of a topic is spoilt; return record and faults by kind."""

    def encode(k, row):
        raw = raw_of(row[2])
        return spoil(raw) if row[0] == topic and k // 3 % 10 == 5 else raw

    got = read_record(write(tmp_path / "a.mcap", McapFile(encode=encode).file()), strict=strict)
    return got, {fault.kind: fault for fault in got.faults}


def _huge_count(raw: bytes) -> bytes:
    """2^31 - 1 joints where there is one."""
    return raw[:20] + struct.pack("<I", 2**31 - 1) + raw[24:]


SPOILT = {
    "cut": lambda raw: raw[:-9],
    "too long": lambda raw: raw + bytes(16),
    "another encoding": lambda raw: b"\x00\x07" + raw[2:],
    "huge count": _huge_count,
    "huge text": lambda raw: raw[:12] + struct.pack("<I", 2**32 - 1) + raw[16:],
    "nanoseconds": lambda raw: raw[:8] + struct.pack("<I", 2**32 - 1) + raw[12:],
    "nothing": lambda raw: b"",
}


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("case", SPOILT)
def test_damaged_messages_are_left_out_and_counted(tmp_path, case, strict):
    got, told = _read(tmp_path, SPOILT[case], "/rsea/joint_states", strict)
    fault = told["damaged_messages"]
    assert (fault.channel, fault.size, fault.unit) == ("/rsea/joint_states", 6, "messages")
    assert fault.share == pytest.approx(0.1)
    kept = [k for k in range(COUNT) if k % 10 != 5]
    assert np.allclose(got["position"].y, np.array(kept) * 0.1)
    assert len(got["ft"]) == COUNT and len(got["command"]) == COUNT
    assert not strict or told["dropped_samples"].share == pytest.approx(0.1)


def test_fields_empty_in_some_messages_are_reported(tmp_path):
    rows = run_rows(COUNT)
    for k in (7, 8, 30):
        _, at, message = rows[3 * k + 1]
        message.velocity = np.array([])
        rows[3 * k + 1] = ("/rsea/joint_states", at, message)
    got = read_record(write_foreign(tmp_path / "bag", rows))
    told = {fault.kind: fault for fault in got.faults}
    assert (told["empty_fields"].channel, told["empty_fields"].size) == ("/rsea/joint_states", 3)
    assert "velocity" in told["empty_fields"].detail
    assert len(got["velocity"]) == COUNT - 3 and len(got["position"]) == COUNT


def test_a_joint_whose_name_is_not_utf_8_can_be_named(tmp_path):
    got, told = _read(tmp_path, lambda raw: raw.replace(b"joint", b"jo\xff\xfet"), "/rsea/ft", True)
    assert told == {} and len(got["ft"]) == COUNT
    encode = lambda k, row: raw_of(row[2]).replace(b"joint", b"jo\xff\nt") if k else raw_of(row[2])  # noqa: E731
    with pytest.raises(BagError, match="2 joints") as caught:
        read_record(write(tmp_path / "b.mcap", McapFile(encode=encode).file()))
    assert "\n" not in str(caught.value)


NULLS = (
    "ALTER TABLE messages RENAME TO whole",
    "CREATE TABLE messages AS SELECT topic_id, timestamp, "
    "CASE WHEN id IN (3, 30, 33) THEN NULL ELSE data END AS data FROM whole",
)
LOST = ("DELETE FROM messages WHERE id BETWEEN 100 AND 129",)
NO_TOPIC = ("UPDATE messages SET topic_id = 77 WHERE id IN (4, 5)",)


@pytest.mark.parametrize(
    ("statements", "expected"),
    [
        (NULLS, {("damaged_messages", "bag.db3"): 3, ("missing_messages", "/rsea/ft"): 3}),
        (LOST, {("missing_messages", f"/rsea/{name}"): 10 for name in ("ft", "joint_states")}),
        (NO_TOPIC, {("damaged_messages", "bag.db3"): 2, ("missing_messages", "/rsea/joint_states"): 1}),
    ],
)
def test_rows_that_are_missing_or_damaged_are_reported(tmp_path, statements, expected):
    got = read_record(spoilt_database(tmp_path / "bag", *statements))
    told = {(fault.kind, fault.channel): fault.size for fault in got.faults}
    assert expected.items() <= told.items()


def test_more_messages_than_the_metadata_say_are_reported(tmp_path):
    bag = write_foreign(tmp_path / "bag", run_rows(COUNT))
    file = bag / "metadata.yaml"
    file.write_text(file.read_text().replace("message_count: 60", "message_count: 55"))
    told = {(fault.kind, fault.channel): fault.size for fault in read_record(bag).faults}
    assert told["surplus_messages", "/rsea/ft"] == 5


def test_one_unreadable_file_of_several_is_left_out(tmp_path):
    bag = write_foreign(tmp_path / "bag", run_rows(COUNT))
    (bag / "metadata.yaml").unlink()
    (bag / "bag_1.mcap").write_bytes(b"")
    got = read_record(bag)
    assert len(got["ft"]) == COUNT
    assert [(f.kind, f.channel) for f in got.faults] == [("damaged_file", "bag_1.mcap")]


def test_a_journal_left_behind_is_reported(tmp_path):
    bag = spoilt_database(tmp_path / "bag")
    (bag / "bag.db3-journal").write_bytes(b"x" * 600)
    got = read_record(bag)
    assert [(f.kind, f.channel) for f in got.faults] == [("cut_off", "bag.db3")]
    assert (bag / "bag.db3-journal").read_bytes() == b"x" * 600
