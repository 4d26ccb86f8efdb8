"""An MCAP file read, damaged or not.

A record is an opcode (1 byte), a length (8 bytes) and a content; numbers are little-endian. Damaged parts are
left out and reported; the rest is read.
"""

import mmap
import struct
import zlib
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from msg_adapters.compression import ERRORS, Allowance, unpack_chunk
from msg_adapters.contents import REMARKS, Contents, remarks_of

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


UNITS = {
    "damaged_chunks": "chunks",
    "damaged_messages": "messages",
    "damaged_records": "bytes",
    "data_after_end": "records",
    "unknown_records": "records",
}
"""Unit of the size of each kind of fault."""
CUT_OFF = "cut off (recorder killed?), read up to its last complete message"


def scan(path: Path, contents: Contents, allowance: Allowance) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    A file without an end (its recorder was killed) gives its complete part and a note.
    Raises ValueError for a file that is not an MCAP.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"no MCAP file, expected it to start with {MAGIC!r}")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as buffer:
            summary = read_summary(buffer)
            scanner = _Scanner(contents, summary, allowance)
            complete = scanner.run(buffer)
    if not complete:
        contents.notes.append(CUT_OFF)
        contents.tell("cut_off", path.name, CUT_OFF)
    if complete and summary.damage:
        scanner.add("checksum_mismatch", summary.damage)
    for kind, (count, first) in scanner.damage.items():
        detail = f"damaged MCAP: {'first: ' if count > 1 else ''}{first}"
        contents.tell(kind, path.name, detail, count if kind in UNITS else None, UNITS.get(kind, ""))
    scanner.compare(path.name)


class _Scanner:
    """The channels of one file while it is read, the destination of their messages, and the damage.

    Schemas and channels repeated in the summary replace damaged records.
    """

    def __init__(self, contents: Contents, summary: McapSummary, allowance: Allowance) -> None:
        self.contents, self.summary, self.allowance = contents, summary, allowance
        self.damage: dict[str, tuple[int, str]] = {}
        self.declared = Declarations(dict(summary.types), dict(summary.channels))
        self.sinks = {key: contents.sink(*channel) for key, channel in summary.channels.items()}
        self.read: Counter[str] = Counter()
        self.ended = False

    def add(self, kind: str, detail: str, count: int = 1) -> None:
        """Count damage; the first detail of a kind is kept."""
        before, first = self.damage.get(kind, (0, detail))
        self.damage[kind] = (before + count, first)

    def run(self, buffer: Buffer) -> bool:
        """Take all records of the file; return whether the end of the data was among them."""
        at, stop = len(MAGIC), len(buffer)
        while at < stop:
            if buffer[at : at + len(MAGIC)] == MAGIC:
                at += len(MAGIC)
                continue
            opcode, size = RECORD.unpack_from(buffer, at) if at + RECORD.size <= stop else (0, 0)
            if opcode == 0 or at + RECORD.size + size > stop:
                later = self.summary.chunks[bisect_right(self.summary.chunks, at) :]
                following = next((c for c in later if c < stop and buffer[c] == CHUNK), None)
                if following is None:
                    if opcode == CHUNK and not self.ended:  # its present part, unless it is compressed
                        self._chunk(buffer, at + RECORD.size, stop, complete=False)
                    elif self.ended:
                        rest = f"{stop - at} bytes at byte {at} are not records"
                        self.add("damaged_records", rest, stop - at)
                    return self.ended
                self.add("damaged_records", f"no record at byte {at}", following - at)
                at = following
                continue
            self._take(buffer, opcode, at + RECORD.size, at + RECORD.size + size)
            at += RECORD.size + size
        return self.ended

    def compare(self, file: str) -> None:
        """Report topics whose number of messages differs from the statistics of the file."""
        expected: Counter[str] = Counter()
        for key, count in self.summary.counts.items():
            topic, _ = self.summary.channels.get(key) or self.declared.channels.get(key, ("", ""))
            expected[topic] += count
        for topic in {**expected, **self.read} if self.summary.counts else ():
            self.contents.compare(topic, expected[topic], self.read[topic], f"the statistics of {file}")
        total = self.summary.total
        if total is not None and not self.summary.counts and total != self.read.total():
            detail = f"{self.read.total()} read, {total} expected from the statistics"
            self.contents.tell("missing_messages", file, detail, abs(total - self.read.total()), "messages")

    def _take(self, buffer: Buffer, opcode: int, first: int, stop: int) -> None:
        if self.ended and opcode in (MESSAGE, CHUNK, DATA_END):
            at = first - RECORD.size
            self.add("data_after_end", f"at byte {at}, behind the end of the data")
        if opcode == CHUNK:
            self._chunk(buffer, first, stop, complete=True)
        elif opcode in (DATA_END, FOOTER):
            self.ended = True
            self._check_data(buffer, opcode, first, stop)
        elif opcode == ATTACHMENT:
            checksum = number(buffer, stop - 4, 4, stop) if stop - first > 4 else 0
            if checksum and zlib.crc32(buffer[first : stop - 4]) != checksum:
                where = f"of the attachment at byte {first - RECORD.size}"
                self.add("checksum_mismatch", f"the checksum {where} does not fit its content")
        else:
            self._small(buffer, opcode, first, stop, 0)

    def _metadata(self, buffer: Buffer, first: int, stop: int) -> None:
        name, at = text(buffer, first, stop)
        if name != REMARKS:
            return
        at, texts = at + 4, {}
        while at < stop:
            key, at = text(buffer, at, stop)
            texts[key], at = text(buffer, at, stop)
        self.contents.take(remarks_of(texts))

    def _small(self, buffer: Buffer, opcode: int, first: int, stop: int, base: int) -> None:
        """Process a record of a file or of a chunk, whose records begin at byte `base` of the file.

        Statistics count where the footer does not lead to them.
        """
        try:
            if opcode == MESSAGE:
                self._message(buffer, first, stop, base)
            elif opcode == SCHEMA:
                self.declared.schema(buffer, first, stop)
            elif opcode == CHANNEL:
                key = self.declared.channel(buffer, first, stop)
                self.sinks[key] = self.contents.sink(*self.declared.channels[key])
            elif base or opcode not in KNOWN:
                where = f"in the chunk at byte {base}" if base else f"at byte {first}"
                self.add("unknown_records", f"opcode {opcode:#04x} {where}")
            elif opcode == METADATA:
                self._metadata(buffer, first, stop)
            elif opcode == STATISTICS and self.summary.total is None:
                take_statistics(buffer, first, stop, self.summary)
        except ValueError as error:
            self.add("damaged_records", f"at byte {base + first}: {error}", stop - first)

    def _message(self, buffer: Buffer, first: int, stop: int, base: int) -> None:
        if stop - first < MESSAGE_HEAD.size:
            self.add("damaged_messages", f"of {stop - first} bytes at byte {base + first}")
            return
        channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(buffer, first)
        if channel not in self.sinks:
            self.add("damaged_messages", f"of channel {channel}, which nothing declares")
            return
        self.read[self.declared.channels[channel][0]] += 1
        if (sink := self.sinks[channel]) is not None:
            sink.log_times.append(log_time)
            sink.raw.append(buffer[first + MESSAGE_HEAD.size : stop])

    def _check_data(self, buffer: Buffer, opcode: int, first: int, stop: int) -> None:
        """Compare the checksum of everything before DATA_END; some writers leave the magic out of it."""
        checksum = number(buffer, first, 4, stop) if opcode == DATA_END and stop - first >= 4 else 0
        if not checksum:
            return
        end, magic = first - RECORD.size, len(MAGIC)
        with memoryview(buffer) as view, view[:end] as data, data[magic:] as rest:
            if zlib.crc32(data) != checksum and zlib.crc32(rest) != checksum:
                self.add("checksum_mismatch", "the checksum of the data does not fit them")

    def _chunk(self, buffer: Buffer, first: int, stop: int, complete: bool) -> None:
        """Take the records of a chunk; of one that breaks off only where they are not compressed."""
        where = f"chunk at byte {first - RECORD.size}"
        try:
            records = self._unpack(buffer, first, stop, complete)
        except (*ERRORS, ValueError, struct.error) as error:
            if complete:
                self.add("damaged_chunks", f"{where} left out: {error}")
            return
        at = 0
        while at + RECORD.size <= len(records):
            opcode, size = RECORD.unpack_from(records, at)
            end = at + RECORD.size + size
            if end > len(records):
                break
            self._small(records, opcode, at + RECORD.size, end, first - RECORD.size)
            at = end
        if complete and at < len(records):
            self.add("damaged_chunks", f"{where} breaks off after {at} of {len(records)} bytes")

    def _unpack(self, buffer: Buffer, first: int, stop: int, complete: bool) -> bytes:
        """Return the records of a chunk. Raises ValueError where they contradict its header."""
        if first + CHUNK_HEAD.size > stop:
            raise ValueError(f"it has {stop - first} bytes")
        _, _, declared, checksum = CHUNK_HEAD.unpack_from(buffer, first)
        compression, at = text(buffer, first + CHUNK_HEAD.size, stop)
        length = number(buffer, at, 8, stop)
        if complete and at + 8 + length != stop:
            raise ValueError(f"it has {stop - at - 8} bytes, expected the {length} that it declares")
        if compression and not complete:
            return b""
        records = unpack_chunk(compression, buffer[at + 8 : stop], declared, self.allowance)
        if complete and checksum and zlib.crc32(records) != checksum:
            raise ValueError("its checksum does not fit its content")
        if complete and len(records) != declared:
            raise ValueError(f"it holds {len(records)} bytes, expected the {declared} that it declares")
        return records
