"""Damage of MCAP files, kind by kind, done to any run."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from mcap_bytes import ATTACHMENT, CHUNK_ROWS, DATA_END, MESSAGE, McapFile, chunk, message, record, text


@dataclass(frozen=True)
class Run:
    """A run as a file with and without chunks. wrenches: the rows that are its F/T messages."""

    bare: McapFile
    chunked: McapFile

    @cached_property
    def wrenches(self) -> Sequence[int]:
        """The numbers of the rows of the F/T sensor."""
        return [k for k, row in enumerate(self.bare.rows) if row[0] == "/rsea/ft"]


def flip(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :]


def lost_messages(run):
    kept = [m for k, m in enumerate(run.bare.messages) if k not in run.wrenches[20:27]]
    return run.bare.file([run.bare.declared, *kept])


def lost_in_a_chunk(run):
    """Messages missing from a chunk whose own checksum fits."""
    parts = run.chunked.data()
    kept = [m for k, m in enumerate(run.chunked.messages[CHUNK_ROWS : 2 * CHUNK_ROWS]) if k % 3 or k < 15]
    return run.chunked.file([parts[0], chunk(b"".join(kept)), *parts[2:]])


def flipped_number(run):
    """One bit of one value: nothing but the checksum of the data can tell."""
    data = run.bare.file()
    one = run.bare.messages[run.wrenches[9]]
    return flip(data, data.index(one) + len(one) - 2)


def flipped_in_chunk(run):
    parts = run.chunked.data()
    parts[2] = flip(parts[2], 200)
    return run.chunked.file(parts)


def chunk_breaks_off(run):
    inner = run.chunked.messages[CHUNK_ROWS : 2 * CHUNK_ROWS]
    broken = record(MESSAGE, inner[15][9:])[:1] + struct.pack("<Q", 10**6) + inner[15][9:]
    parts = run.chunked.data()
    parts[1] = chunk(b"".join([*inner[:15], broken, *inner[16:]]))
    return run.chunked.file(parts)


def ended_in_the_middle(run):
    parts = run.chunked.data()
    return run.chunked.file([*parts[:3], record(DATA_END, bytes(4)), *parts[3:]])


def unknown_records(run):
    changed = [b"\x45" + m[1:] if k in run.wrenches[5:8] else m for k, m in enumerate(run.bare.messages)]
    return run.bare.file([run.bare.declared, *changed])


def chunk_in_a_chunk(run):
    parts = run.chunked.data()
    return run.chunked.file([*parts[:1], chunk(parts[1]), *parts[2:]])


def undeclare(run):
    strays = [message(99, 5, b"\x00\x01\x00\x00") for _ in range(4)]
    return run.bare.file([run.bare.declared, *run.bare.messages, *strays])


def attachment(run):
    content = struct.pack("<QQ", 0, 0) + text("a") + text("b") + struct.pack("<Q", 1) + b"x"
    return run.bare.file([*run.bare.data(), record(ATTACHMENT, content + struct.pack("<I", 77))])


def summary(run):
    data = run.bare.file()
    at = data.rindex(b"/rsea/ft")
    return flip(data, at)


def no_records(run):
    data = run.bare.file()
    return data[: -len(run.bare.summary()) - 37] + b"\x00" * 40 + data[-37:]


def footer_leads_nowhere(run):
    """Messages lost, and a footer without a place for the summary that counts them."""
    data = lost_messages(run)
    return data[:-28] + bytes(20) + data[-8:]
