"""Records of an MCAP file, and its summary.

A record is an opcode (1 byte), a length (8 bytes) and a content; numbers are little-endian.
"""

import mmap
import struct
import zlib
from dataclasses import dataclass, field

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


@dataclass
class Declarations:
    """Message types and topics by their number in the file."""

    types: dict[int, str] = field(default_factory=dict)
    channels: dict[int, tuple[str, str]] = field(default_factory=dict)

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


@dataclass
class McapSummary(Declarations):
    """counts: messages by channel. total: of all channels. chunks: first byte of each, rising.

    damage: why it cannot be trusted, empty where it can.
    """

    counts: dict[int, int] = field(default_factory=dict)
    total: int | None = None
    chunks: list[int] = field(default_factory=list)
    damage: str = ""


def read_summary(buffer: Buffer) -> McapSummary:
    """Return the summary of a file; an empty one where it has none."""
    summary = McapSummary()
    footer = len(buffer) - len(MAGIC) - RECORD.size - FOOTER_CONTENT.size
    is_ended = footer >= len(MAGIC) and buffer[-len(MAGIC) :] == MAGIC
    if not is_ended or RECORD.unpack_from(buffer, footer) != (FOOTER, FOOTER_CONTENT.size):
        return McapSummary(damage="it does not end with a footer")
    start, _, checksum = FOOTER_CONTENT.unpack_from(buffer, footer + RECORD.size)
    if start == 0:
        return summary
    if not len(MAGIC) <= start <= footer:
        return McapSummary(damage=f"the footer places the summary at byte {start}, behind its own {footer}")
    end = footer + RECORD.size + FOOTER_CONTENT.size - 4
    if checksum and zlib.crc32(buffer[start:end]) != checksum:
        return McapSummary(damage="the checksum of the summary does not fit its content")
    at = start
    try:
        while at < footer:
            opcode, size = RECORD.unpack_from(buffer, at)
            first = at + RECORD.size
            at = first + size
            if at > footer:
                raise ValueError(f"a record ends at byte {at}, behind the footer at {footer}")
            if opcode == SCHEMA:
                summary.schema(buffer, first, at)
            elif opcode == CHANNEL:
                summary.channel(buffer, first, at)
            elif opcode == CHUNK_INDEX:
                summary.chunks.append(number(buffer, first + 16, 8, at))
            elif opcode == STATISTICS:
                take_statistics(buffer, first, at, summary)
    except (ValueError, struct.error) as error:
        return McapSummary(damage=f"the summary is damaged: {error}")
    summary.chunks.sort()
    return summary


def take_statistics(buffer: Buffer, first: int, stop: int, summary: McapSummary) -> None:
    """Read a STATISTICS record. Raises ValueError for a damaged one."""
    if first + STATISTICS_HEAD.size > stop:
        raise ValueError("the statistics end too early")
    summary.total = STATISTICS_HEAD.unpack_from(buffer, first)[0]
    at = first + STATISTICS_HEAD.size
    end = at + 4 + number(buffer, at, 4, stop)
    if end > stop:
        raise ValueError("the counts of the statistics end too early")
    for entry in range(at + 4, end - 9, 10):
        summary.counts[number(buffer, entry, 2, end)] = number(buffer, entry + 2, 8, end)
