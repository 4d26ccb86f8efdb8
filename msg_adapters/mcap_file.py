"""MCAP files read from front to back, without their index, so that a cut-off file reads as well.

Format: https://mcap.dev/spec. A record is an opcode (1 byte), a length (8 bytes) and a content.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from pathlib import Path

from msg_adapters.compression import CHUNK_FORMATS, ERRORS
from msg_adapters.contents import Contents, Messages

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F

RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
CHUNK_HEAD = struct.Struct("<QQQI")

Buffer = bytes | mmap.mmap


def scan(path: Path, contents: Contents) -> None:
    """Add all messages of a file to the contents, in the order in which they were written.

    A file without end (its recorder was killed) gives what is complete, and a note.
    Raises ValueError for a file that is no MCAP and for damage before the end.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"no MCAP file, expected it to start with {MAGIC!r}")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as buffer:
            try:
                complete = _Scanner(contents).run(buffer, len(MAGIC), len(buffer))
            except (*ERRORS, ValueError, struct.error) as error:
                raise ValueError(f"damaged MCAP: {error}") from None
    if not complete:
        contents.notes.append("cut off (recorder killed?), read up to its last complete message")


class _Scanner:
    """The schemas and channels of one file, as they come along."""

    def __init__(self, contents: Contents) -> None:
        self.contents = contents
        self.types: dict[int, str] = {}
        self.sinks: dict[int, Messages | None] = {}

    def run(self, buffer: Buffer, at: int, stop: int) -> bool:
        """Take the records from `at` to `stop`; return whether the end of the data was among them."""
        while at + RECORD.size <= stop:
            opcode, size = RECORD.unpack_from(buffer, at)
            first = at + RECORD.size
            at = first + size
            if opcode in (DATA_END, FOOTER):
                return True
            if opcode == CHUNK and first + CHUNK_HEAD.size + 12 <= stop:
                self._chunk(buffer, first, min(at, stop), complete=at <= stop)
            if at > stop:
                return False
            if opcode == MESSAGE:
                channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(buffer, first)
                sink = self._sink(channel)
                if sink is not None:
                    sink.log_times.append(log_time)
                    sink.raw.append(buffer[first + MESSAGE_HEAD.size : at])
            elif opcode == SCHEMA:
                self.types[_uint16(buffer, first)] = _text(buffer, first + 2)[0]
            elif opcode == CHANNEL:
                self._channel(buffer, first)
        return False

    def _sink(self, channel: int) -> Messages | None:
        if channel not in self.sinks:
            raise ValueError(f"message of channel {channel}, which nothing declares before it")
        return self.sinks[channel]

    def _channel(self, buffer: Buffer, first: int) -> None:
        topic, at = _text(buffer, first + 4)
        encoding, _ = _text(buffer, at)
        msgtype = self.types.get(_uint16(buffer, first + 2), "unknown")
        if encoding != "cdr":
            msgtype = f"{msgtype} ({encoding})"
        self.sinks[_uint16(buffer, first)] = self.contents.sink(topic, msgtype)

    def _chunk(self, buffer: Buffer, first: int, stop: int, complete: bool) -> None:
        *_, checksum = CHUNK_HEAD.unpack_from(buffer, first)
        compression, at = _text(buffer, first + CHUNK_HEAD.size)
        if compression not in CHUNK_FORMATS:
            raise ValueError(f"chunk compression {compression!r}, expected none, zstd or lz4")
        if compression and not complete:
            return
        records = CHUNK_FORMATS[compression](buffer[at + 8 : stop])
        if complete and checksum and zlib.crc32(records) != checksum:
            raise ValueError(f"checksum of the chunk at byte {first - RECORD.size} does not fit its content")
        self.run(records, 0, len(records))


def _uint16(buffer: Buffer, at: int) -> int:
    return int.from_bytes(buffer[at : at + 2], "little")


def _text(buffer: Buffer, at: int) -> tuple[str, int]:
    """Return a text and where it ends."""
    end = at + 4 + int.from_bytes(buffer[at : at + 4], "little")
    return buffer[at + 4 : end].decode(), end
