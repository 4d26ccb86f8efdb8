"""The summary at the end of an MCAP file: numbers of messages, and places of the chunks."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

from msg_adapters.mcap_records import (
    CHANNEL,
    CHUNK_INDEX,
    FOOTER,
    FOOTER_CONTENT,
    MAGIC,
    RECORD,
    SCHEMA,
    STATISTICS,
    STATISTICS_HEAD,
    Buffer,
    Declarations,
    number,
)

NO_END = "it does not end with a footer"


@dataclass
class McapSummary:
    """counts: messages by channel. total: of all channels. chunks: first byte of each, rising.

    damage: why it cannot be trusted, empty where it can.
    """

    declared: Declarations = field(default_factory=Declarations)
    counts: dict[int, int] = field(default_factory=dict)
    total: int | None = None
    chunks: list[int] = field(default_factory=list)
    damage: str = ""


def read_summary(buffer: Buffer) -> McapSummary:
    """Return the summary of a file; an empty one where it has none."""
    summary = McapSummary()
    footer = len(buffer) - len(MAGIC) - RECORD.size - FOOTER_CONTENT.size
    if footer < len(MAGIC) or buffer[-len(MAGIC) :] != MAGIC:
        return McapSummary(damage=NO_END)
    if RECORD.unpack_from(buffer, footer) != (FOOTER, FOOTER_CONTENT.size):
        return McapSummary(damage=NO_END)
    start, _, checksum = FOOTER_CONTENT.unpack_from(buffer, footer + RECORD.size)
    if start == 0:
        return summary
    if not len(MAGIC) <= start <= footer:
        return McapSummary(damage=f"the footer places the summary at byte {start}, behind its own {footer}")
    end = footer + RECORD.size + FOOTER_CONTENT.size - 4
    if checksum and zlib.crc32(buffer[start:end]) != checksum:
        return McapSummary(damage="the checksum of the summary does not fit its content")
    try:
        _records(buffer, start, footer, summary)
    except (ValueError, struct.error) as error:
        return McapSummary(damage=f"the summary is damaged: {error}")
    return summary


def _records(buffer: Buffer, at: int, stop: int, summary: McapSummary) -> None:
    while at < stop:
        opcode, size = RECORD.unpack_from(buffer, at)
        first = at + RECORD.size
        at = first + size
        if at > stop:
            raise ValueError(f"a record ends at byte {at}, behind the footer at {stop}")
        if opcode == SCHEMA:
            summary.declared.schema(buffer, first, at)
        elif opcode == CHANNEL:
            summary.declared.channel(buffer, first, at)
        elif opcode == CHUNK_INDEX:
            summary.chunks.append(number(buffer, first + 16, 8, at))
        elif opcode == STATISTICS:
            take_statistics(buffer, first, at, summary)
    summary.chunks.sort()


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
