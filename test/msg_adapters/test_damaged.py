"""Damaged files and messages: sound parts are used, the others left out and counted; never a traceback."""

import math
import random
import shutil
import struct
import zlib

import mcap_damage_kinds as kinds
import numpy as np
import pytest
from foreign import raw_of, run_rows, spoilt_database, write_foreign
from mcap_bytes import McapFile, write
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from msg_adapters import read_record
from rsea_ros.errors import BagError, RseaError
from rsea_ros.records.stamps import repair_stamps

RUN = kinds.Run(McapFile(chunked=False), McapFile())


CASES = {
    "footer leads nowhere": (kinds.footer_leads_nowhere, {"missing_messages": ("/rsea/ft", 7)}, 7),
    "lost messages": (kinds.lost_messages, {"missing_messages": ("/rsea/ft", 7)}, 7),
    "lost in a chunk": (kinds.lost_in_a_chunk, {"missing_messages": ("/rsea/torque_command", 5)}, 0),
    "flipped number": (kinds.flipped_number, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "flipped in a chunk": (kinds.flipped_in_chunk, {"damaged_chunks": ("a.mcap", 1)}, 10),
    "chunk breaks off": (kinds.chunk_breaks_off, {"damaged_chunks": ("a.mcap", 1)}, 5),
    "ended in the middle": (kinds.ended_in_the_middle, {"data_after_end": ("a.mcap", 4)}, 0),
    "unknown records": (kinds.unknown_records, {"unknown_records": ("a.mcap", 3)}, 3),
    "chunk in a chunk": (kinds.chunk_in_a_chunk, {"unknown_records": ("a.mcap", 1)}, 10),
    "undeclared channel": (kinds.undeclare, {"damaged_messages": ("a.mcap", 4)}, 0),
    "attachment": (kinds.attachment, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "summary": (kinds.summary, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "no records": (kinds.no_records, {"damaged_records": ("a.mcap", None)}, 0),
}


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_damage_is_reported_and_the_rest_is_used(tmp_path, case, strict):
    make, expected, lost = CASES[case]
    got = read_record(write(tmp_path / "a.mcap", make(RUN)), strict=strict)
    told = {fault.kind: fault for fault in got.faults}
    for kind, (where, size) in expected.items():
        assert told[kind].channel == where and told[kind].detail
        assert size is None or told[kind].size == size
    assert len(got["ft"]) == len(RUN.wrenches) - lost
    if lost:
        missing = next(f for f in got.faults if f.kind == "missing_messages" and f.channel == "/rsea/ft")
        assert missing.size == lost and math.isclose(missing.share, lost / len(RUN.wrenches))


@pytest.mark.parametrize("file", [RUN.bare, RUN.chunked])
def test_a_sound_file_has_no_fault(tmp_path, file):
    got = read_record(write(tmp_path / "a.mcap", file.file()))
    assert got.faults == () and got.notes == ()
    assert np.array_equal(got["ft"].y, np.arange(60) * 0.7)


def test_a_damaged_length_costs_one_chunk_where_the_index_is_whole(tmp_path):
    from foreign import write_foreign

    from msg_adapters import BagWriter, iterate

    with BagWriter(tmp_path / "long.mcap") as bag:
        for k, (name, kind, at, raw) in enumerate(iterate(write_foreign(tmp_path / "b", run_rows(60)))):
            bag.write(name, kind, at, raw)
            if k % 30 == 29:
                bag.flush()
    data = bytearray((tmp_path / "long.mcap").read_bytes())
    chunks = [at for at in range(len(data)) if data[at : at + 1] == b"\x06" and _is_chunk(data, at)]
    data[chunks[2] + 6] = 0x7F
    got = read_record(write(tmp_path / "a.mcap", bytes(data)))
    assert len(got["ft"]) == 50
    assert {"damaged_records", "missing_messages"} <= {fault.kind for fault in got.faults}


def _is_chunk(data: bytearray, at: int) -> bool:
    size = int.from_bytes(data[at + 1 : at + 9], "little")
    inner = data[at + 49 : at + 9 + size]
    return 40 < size < len(data) and zlib.crc32(inner) == int.from_bytes(data[at + 33 : at + 37], "little")


def test_a_bag_without_a_sound_chunk_is_refused_in_one_line(tmp_path):
    parts = [kinds.flip(part, 200) for part in RUN.chunked.data()]
    with pytest.raises(
        BagError, match=r"no message on /rsea/torque_command.*damaged MCAP.*checksum"
    ) as caught:
        read_record(write(tmp_path / "a.mcap", RUN.chunked.file(parts)))
    assert "\n" not in str(caught.value)


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


MUTATIONS = 10
NUMBERS = (0, 1, 255, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
KINDS = {
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "packed chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "packed messages": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "database": (StoragePlugin.SQLITE3, CompressionMode.NONE),
}


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Return data with a bit, a byte, a number, or a stretch changed, taken out, doubled, or cut off."""
    out, at = bytearray(data), rng.randrange(len(data))
    kind = rng.randrange(6)
    if kind == 0:
        out[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        out[at] = rng.randrange(256)
    elif kind == 2:
        form = rng.choice("HIQ")
        size = struct.calcsize(form)
        out[at : at + size] = struct.pack(f"<{form}", rng.choice(NUMBERS) % 256**size)
    elif kind == 3:
        del out[at : at + rng.choice((1, 8, 100))]
    elif kind == 4:
        out[at:at] = out[at : at + rng.choice((1, 8, 100))]
    else:
        del out[at:]
    return bytes(out)


def _read_or_refuse(path) -> None:
    for strict in (True, False):
        try:
            record = read_record(path, strict=strict)
            repair_stamps(record)
        except RseaError as error:
            assert "\n" not in str(error) and len(str(error)) < 3000


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_anywhere_in_a_file_gives_a_record_or_one_line(tmp_path, kind):
    rng = random.Random(kind)
    bag = write_foreign(tmp_path / "bag", run_rows(20), *KINDS[kind])
    file = next(path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    for _ in range(MUTATIONS):
        file.write_bytes(mutate(data, rng) or b"\0")
        _read_or_refuse(bag)
    shutil.rmtree(bag)


def test_a_fault_anywhere_in_a_chunk_whose_checksum_fits_gives_a_record_or_one_line(tmp_path):
    rng = random.Random(8)
    file = McapFile(run_rows(20))
    sound = list(file.messages)
    for _ in range(MUTATIONS):
        file.messages = list(sound)
        for _ in range(3):
            at = rng.randrange(len(sound))
            file.messages[at] = mutate(sound[at], rng)
        (tmp_path / "a.mcap").write_bytes(file.file())
        _read_or_refuse(tmp_path / "a.mcap")


def test_a_fault_anywhere_in_the_metadata_gives_a_record_or_one_line(tmp_path):
    rng = random.Random(9)
    bag = write_foreign(tmp_path / "bag", run_rows(20))
    text = (bag / "metadata.yaml").read_bytes()
    for _ in range(MUTATIONS):
        (bag / "metadata.yaml").write_bytes(mutate(text, rng))
        _read_or_refuse(bag)
