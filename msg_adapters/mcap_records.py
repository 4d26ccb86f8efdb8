"""Records of an MCAP file. Format: https://mcap.dev/spec.

A record is an opcode (1 byte), a length (8 bytes) and a content; numbers are little-endian.
"""

from __future__ import annotations

import mmap
import struct

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT = range(1, 10)
ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(10, 16)
KNOWN = range(HEADER, DATA_END + 1)

RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
CHUNK_HEAD = struct.Struct("<QQQI")
FOOTER_CONTENT = struct.Struct("<QQI")
STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")

Buffer = bytes | mmap.mmap


def number(buffer: Buffer, at: int, size: int, stop: int) -> int:
    """Return an unsigned number of some bytes. Raises ValueError where the record ends before it does."""
    if at + size > stop:
        raise ValueError(f"ends at byte {stop}, within a number")
    return int.from_bytes(buffer[at : at + size], "little")


def text(buffer: Buffer, at: int, stop: int) -> tuple[str, int]:
    """Return a text and where it ends. Raises ValueError where the record ends before it does."""
    end = at + 4 + number(buffer, at, 4, stop)
    if end > stop:
        raise ValueError(f"ends at byte {stop}, within a text of {end - at - 4} bytes")
    return buffer[at + 4 : end].decode(errors="replace"), end


class Declarations:
    """Message types and topics by their number in the file."""

    def __init__(self) -> None:
        self.types: dict[int, str] = {}
        self.channels: dict[int, tuple[str, str]] = {}

    def schema(self, buffer: Buffer, first: int, stop: int) -> None:
        """Read a SCHEMA record."""
        self.types[number(buffer, first, 2, stop)] = text(buffer, first + 2, stop)[0]

    def channel(self, buffer: Buffer, first: int, stop: int) -> int:
        """Read a CHANNEL record; return its number."""
        key = number(buffer, first, 2, stop)
        topic, at = text(buffer, first + 4, stop)
        encoding, _ = text(buffer, at, stop)
        msgtype = self.types.get(number(buffer, first + 2, 2, stop), "unknown")
        self.channels[key] = (topic, msgtype if encoding == "cdr" else f"{msgtype} ({encoding})")
        return key
