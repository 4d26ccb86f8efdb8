"""An MCAP file read, damaged or not.

Damaged parts are left out and reported; the rest is read.
"""

import mmap
import struct
import zlib
from bisect import bisect_right
from collections import Counter
from pathlib import Path

from msg_adapters import mcap_records as mcap
from msg_adapters.compression import ERRORS, Allowance, unpack_chunk
from msg_adapters.contents import NAME as REMARKS, Contents, remarks_of

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
        if file.read(len(mcap.MAGIC)) != mcap.MAGIC:
            raise ValueError(f"no MCAP file, expected it to start with {mcap.MAGIC!r}")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as buffer:
            summary = mcap.read_summary(buffer)
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

    def __init__(self, contents: Contents, summary: mcap.McapSummary, allowance: Allowance) -> None:
        self.contents, self.summary, self.allowance = contents, summary, allowance
        self.damage: dict[str, tuple[int, str]] = {}
        self.declared = mcap.Declarations(dict(summary.types), dict(summary.channels))
        self.sinks = {key: contents.sink(*channel) for key, channel in summary.channels.items()}
        self.read: Counter[str] = Counter()
        self.ended = False

    def add(self, kind: str, detail: str, count: int = 1) -> None:
        """Count damage; the first detail of a kind is kept."""
        before, first = self.damage.get(kind, (0, detail))
        self.damage[kind] = (before + count, first)

    def run(self, buffer: mcap.Buffer) -> bool:
        """Take all records of the file; return whether the end of the data was among them."""
        at, stop = len(mcap.MAGIC), len(buffer)
        while at < stop:
            if buffer[at : at + len(mcap.MAGIC)] == mcap.MAGIC:
                at += len(mcap.MAGIC)
                continue
            opcode, size = mcap.RECORD.unpack_from(buffer, at) if at + mcap.RECORD.size <= stop else (0, 0)
            if opcode == 0 or at + mcap.RECORD.size + size > stop:
                later = self.summary.chunks[bisect_right(self.summary.chunks, at) :]
                following = next((c for c in later if c < stop and buffer[c] == mcap.CHUNK), None)
                if following is None:
                    if opcode == mcap.CHUNK and not self.ended:  # its present part, unless it is compressed
                        self._chunk(buffer, at + mcap.RECORD.size, stop, complete=False)
                    elif self.ended:
                        rest = f"{stop - at} bytes at byte {at} are not records"
                        self.add("damaged_records", rest, stop - at)
                    return self.ended
                self.add("damaged_records", f"no record at byte {at}", following - at)
                at = following
                continue
            self._take(buffer, opcode, at + mcap.RECORD.size, at + mcap.RECORD.size + size)
            at += mcap.RECORD.size + size
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

    def _take(self, buffer: mcap.Buffer, opcode: int, first: int, stop: int) -> None:
        if self.ended and opcode in (mcap.MESSAGE, mcap.CHUNK, mcap.DATA_END):
            at = first - mcap.RECORD.size
            self.add("data_after_end", f"at byte {at}, behind the end of the data")
        if opcode == mcap.CHUNK:
            self._chunk(buffer, first, stop, complete=True)
        elif opcode in (mcap.DATA_END, mcap.FOOTER):
            self.ended = True
            self._check_data(buffer, opcode, first, stop)
        elif opcode == mcap.ATTACHMENT:
            checksum = mcap.number(buffer, stop - 4, 4, stop) if stop - first > 4 else 0
            if checksum and zlib.crc32(buffer[first : stop - 4]) != checksum:
                where = f"of the attachment at byte {first - mcap.RECORD.size}"
                self.add("checksum_mismatch", f"the checksum {where} does not fit its content")
        else:
            self._small(buffer, opcode, first, stop, 0)

    def _metadata(self, buffer: mcap.Buffer, first: int, stop: int) -> None:
        name, at = mcap.text(buffer, first, stop)
        if name != REMARKS:
            return
        at, texts = at + 4, {}
        while at < stop:
            key, at = mcap.text(buffer, at, stop)
            texts[key], at = mcap.text(buffer, at, stop)
        self.contents.take(remarks_of(texts))

    def _small(self, buffer: mcap.Buffer, opcode: int, first: int, stop: int, base: int) -> None:
        """Process a record of a file or of a chunk, whose records begin at byte `base` of the file.

        Statistics count where the footer does not lead to them.
        """
        try:
            if opcode == mcap.MESSAGE:
                self._message(buffer, first, stop, base)
            elif opcode == mcap.SCHEMA:
                self.declared.schema(buffer, first, stop)
            elif opcode == mcap.CHANNEL:
                key = self.declared.channel(buffer, first, stop)
                self.sinks[key] = self.contents.sink(*self.declared.channels[key])
            elif base or opcode not in mcap.KNOWN:
                where = f"in the chunk at byte {base}" if base else f"at byte {first}"
                self.add("unknown_records", f"opcode {opcode:#04x} {where}")
            elif opcode == mcap.METADATA:
                self._metadata(buffer, first, stop)
            elif opcode == mcap.STATISTICS and self.summary.total is None:
                mcap.take_statistics(buffer, first, stop, self.summary)
        except ValueError as error:
            self.add("damaged_records", f"at byte {base + first}: {error}", stop - first)

    def _message(self, buffer: mcap.Buffer, first: int, stop: int, base: int) -> None:
        if stop - first < mcap.MESSAGE_HEAD.size:
            self.add("damaged_messages", f"of {stop - first} bytes at byte {base + first}")
            return
        channel, _, log_time, _ = mcap.MESSAGE_HEAD.unpack_from(buffer, first)
        if channel not in self.sinks:
            self.add("damaged_messages", f"of channel {channel}, which nothing declares")
            return
        self.read[self.declared.channels[channel][0]] += 1
        if (sink := self.sinks[channel]) is not None:
            sink.log_times.append(log_time)
            sink.raw.append(buffer[first + mcap.MESSAGE_HEAD.size : stop])

    def _check_data(self, buffer: mcap.Buffer, opcode: int, first: int, stop: int) -> None:
        """Compare the checksum of everything before DATA_END; some writers leave the magic out of it."""
        checksum = mcap.number(buffer, first, 4, stop) if opcode == mcap.DATA_END and stop - first >= 4 else 0
        if not checksum:
            return
        end, magic = first - mcap.RECORD.size, len(mcap.MAGIC)
        with memoryview(buffer) as view, view[:end] as data, data[magic:] as rest:
            if zlib.crc32(data) != checksum and zlib.crc32(rest) != checksum:
                self.add("checksum_mismatch", "the checksum of the data does not fit them")

    def _chunk(self, buffer: mcap.Buffer, first: int, stop: int, complete: bool) -> None:
        """Take the records of a chunk; of one that breaks off only where they are not compressed."""
        where = f"chunk at byte {first - mcap.RECORD.size}"
        try:
            records = self._unpack(buffer, first, stop, complete)
        except (*ERRORS, ValueError, struct.error) as error:
            if complete:
                self.add("damaged_chunks", f"{where} left out: {error}")
            return
        at = 0
        while at + mcap.RECORD.size <= len(records):
            opcode, size = mcap.RECORD.unpack_from(records, at)
            end = at + mcap.RECORD.size + size
            if end > len(records):
                break
            self._small(records, opcode, at + mcap.RECORD.size, end, first - mcap.RECORD.size)
            at = end
        if complete and at < len(records):
            self.add("damaged_chunks", f"{where} breaks off after {at} of {len(records)} bytes")

    def _unpack(self, buffer: mcap.Buffer, first: int, stop: int, complete: bool) -> bytes:
        """Return the records of a chunk. Raises ValueError where they contradict its header."""
        if first + mcap.CHUNK_HEAD.size > stop:
            raise ValueError(f"it has {stop - first} bytes")
        _, _, declared, checksum = mcap.CHUNK_HEAD.unpack_from(buffer, first)
        compression, at = mcap.text(buffer, first + mcap.CHUNK_HEAD.size, stop)
        length = mcap.number(buffer, at, 8, stop)
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
