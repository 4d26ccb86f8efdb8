"""Damaged MCAP files: sound parts are used, the others left out and reported with counts."""

from __future__ import annotations

import math
import struct
import zlib

import numpy as np
import pytest
from foreign import run_rows
from mcap_bytes import (
    ATTACHMENT,
    CHUNK_ROWS,
    DATA_END,
    MESSAGE,
    McapFile,
    chunk,
    message,
    record,
    text,
    write,
)

from msg_adapters import read_record
from rsea_ros.errors import BagError

BARE, CHUNKED = McapFile(chunked=False), McapFile()
FTS = [k for k, row in enumerate(BARE.rows) if row[0] == "/rsea/ft"]


def _flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :]


def _lost_messages():
    kept = [m for k, m in enumerate(BARE.messages) if k not in FTS[20:27]]
    return BARE.file([BARE.declared, *kept])


def _lost_in_a_chunk():
    """Messages missing from a chunk whose own checksum fits."""
    parts = CHUNKED.data()
    kept = [m for k, m in enumerate(CHUNKED.messages[CHUNK_ROWS : 2 * CHUNK_ROWS]) if k % 3 or k < 15]
    return CHUNKED.file([parts[0], chunk(b"".join(kept)), *parts[2:]])


def _flipped_number():
    """One bit of one value: nothing but the checksum of the data can tell."""
    data = BARE.file()
    return _flipped(data, data.index(BARE.messages[FTS[9]]) + len(BARE.messages[FTS[9]]) - 2)


def _flipped_in_chunk():
    parts = CHUNKED.data()
    parts[2] = _flipped(parts[2], 200)
    return CHUNKED.file(parts)


def _chunk_breaks_off():
    inner = CHUNKED.messages[CHUNK_ROWS : 2 * CHUNK_ROWS]
    broken = record(MESSAGE, inner[15][9:])[:1] + struct.pack("<Q", 10**6) + inner[15][9:]
    parts = CHUNKED.data()
    parts[1] = chunk(b"".join([*inner[:15], broken, *inner[16:]]))
    return CHUNKED.file(parts)


def _ended_in_the_middle():
    parts = CHUNKED.data()
    return CHUNKED.file([*parts[:3], record(DATA_END, bytes(4)), *parts[3:]])


def _unknown_records():
    flipped = [b"\x45" + m[1:] if k in FTS[5:8] else m for k, m in enumerate(BARE.messages)]
    return BARE.file([BARE.declared, *flipped])


def _chunk_in_a_chunk():
    parts = CHUNKED.data()
    return CHUNKED.file([*parts[:1], chunk(parts[1]), *parts[2:]])


def _undeclared():
    strays = [message(99, 5, b"\x00\x01\x00\x00") for _ in range(4)]
    return BARE.file([BARE.declared, *BARE.messages, *strays])


def _attachment():
    content = struct.pack("<QQ", 0, 0) + text("a") + text("b") + struct.pack("<Q", 1) + b"x"
    return BARE.file([*BARE.data(), record(ATTACHMENT, content + struct.pack("<I", 77))])


def _summary():
    data = BARE.file()
    at = data.rindex(b"/rsea/ft")
    return _flipped(data, at)


def _no_records():
    data = BARE.file()
    return data[: -len(BARE.summary()) - 37] + b"\x00" * 40 + data[-37:]


def _footer_leads_nowhere():
    """Messages lost, and a footer without a place for the summary that counts them."""
    data = _lost_messages()
    return data[:-28] + bytes(20) + data[-8:]


CASES = {
    "footer leads nowhere": (_footer_leads_nowhere, {"missing_messages": ("/rsea/ft", 7)}, 7),
    "lost messages": (_lost_messages, {"missing_messages": ("/rsea/ft", 7)}, 7),
    "lost in a chunk": (_lost_in_a_chunk, {"missing_messages": ("/rsea/torque_command", 5)}, 0),
    "flipped number": (_flipped_number, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "flipped in a chunk": (_flipped_in_chunk, {"damaged_chunks": ("a.mcap", 1)}, 10),
    "chunk breaks off": (_chunk_breaks_off, {"damaged_chunks": ("a.mcap", 1)}, 5),
    "ended in the middle": (_ended_in_the_middle, {"data_after_end": ("a.mcap", 4)}, 0),
    "unknown records": (_unknown_records, {"unknown_records": ("a.mcap", 3)}, 3),
    "chunk in a chunk": (_chunk_in_a_chunk, {"unknown_records": ("a.mcap", 1)}, 10),
    "undeclared channel": (_undeclared, {"damaged_messages": ("a.mcap", 4)}, 0),
    "attachment": (_attachment, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "summary": (_summary, {"checksum_mismatch": ("a.mcap", None)}, 0),
    "no records": (_no_records, {"damaged_records": ("a.mcap", None)}, 0),
}


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_damage_is_reported_and_the_rest_is_used(tmp_path, case, strict):
    make, expected, lost = CASES[case]
    got = read_record(write(tmp_path / "a.mcap", make()), strict=strict)
    told = {fault.kind: fault for fault in got.faults}
    for kind, (where, size) in expected.items():
        assert told[kind].channel == where and told[kind].detail
        assert size is None or told[kind].size == size
    assert len(got["ft"]) == len(FTS) - lost
    if lost:
        missing = next(f for f in got.faults if f.kind == "missing_messages" and f.channel == "/rsea/ft")
        assert missing.size == lost and math.isclose(missing.share, lost / len(FTS))


@pytest.mark.parametrize("file", [BARE, CHUNKED])
def test_a_sound_file_has_no_fault(tmp_path, file):
    got = read_record(write(tmp_path / "a.mcap", file.file()))
    assert got.faults == () and got.notes == ()
    assert np.array_equal(got["ft"].y, np.arange(60) * 0.7)


def test_a_file_appended_to_another_is_read_and_reported(tmp_path):
    rows = run_rows(60)
    first, second = McapFile(rows[:90]), McapFile(rows[90:])
    got = read_record(write(tmp_path / "a.mcap", first.file() + second.file()))
    assert len(got["ft"]) == 60
    assert "data_after_end" in {fault.kind for fault in got.faults}


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
    parts = [_flipped(part, 200) for part in CHUNKED.data()]
    with pytest.raises(
        BagError, match=r"no message on /rsea/torque_command.*damaged MCAP.*checksum"
    ) as caught:
        read_record(write(tmp_path / "a.mcap", CHUNKED.file(parts)))
    assert "\n" not in str(caught.value)
