"""Damaged MCAP files: sound parts are used, the others left out and reported with counts."""

from __future__ import annotations

import math
import zlib

import mcap_damage_kinds as kinds
import numpy as np
import pytest
from foreign import run_rows
from mcap_bytes import McapFile, write

from msg_adapters import read_record
from rsea_ros.errors import BagError

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
