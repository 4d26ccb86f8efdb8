"""MCAP files put together record by record, by the specification, so that any part can be wrong."""

import struct
import sys
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import lz4.frame
from foreign import Row, raw_of, run_rows

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

PACK: dict[str, Callable[[bytes], bytes]] = {
    "": lambda data: data, "zstd": zstd.compress, "lz4": lz4.frame.compress,
}  # fmt: skip
MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 1, 2, 3, 4, 5, 6
ATTACHMENT, STATISTICS, DATA_END = 9, 11, 15
CHUNK_ROWS = 30


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def message(channel: int, log_time: int, raw: bytes) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, log_time, log_time) + raw)


def chunk(records: bytes, *, checksum: int | None = None, declared: int | None = None, how: str = "",
          packed: bytes | None = None) -> bytes:  # fmt: skip
    data = PACK[how](records) if packed is None else packed
    crc = zlib.crc32(records) if checksum is None else checksum
    head = struct.pack("<QQQI", 0, 0, len(records) if declared is None else declared, crc)
    return record(CHUNK, head + text(how) + struct.pack("<Q", len(data)) + data)


@dataclass
class McapFile:
    """A file of rows. messages: the MESSAGE records, CHUNK_ROWS of them a chunk (chunked), else bare.

    how: the compression of the chunks.
    """

    rows: Sequence[Row] = field(default_factory=lambda: run_rows(60))
    chunked: bool = True
    encode: Callable[[int, Row], bytes] = lambda k, row: raw_of(row[2])
    how: str = ""

    def __post_init__(self) -> None:
        topics = dict.fromkeys((row[0], row[2].__msgtype__) for row in self.rows)
        self.keys = {name: key for key, (name, _) in enumerate(topics, 1)}
        self.declared = b"".join(
            record(SCHEMA, struct.pack("<H", key) + text(kind) + text("") + text(""))
            + record(CHANNEL, struct.pack("<HH", key, key) + text(name) + text("cdr") + text(""))
            for key, (name, kind) in enumerate(topics, 1)
        )
        self.messages = [
            message(self.keys[row[0]], row[1], self.encode(k, row)) for k, row in enumerate(self.rows)
        ]
        names = [row[0] for row in self.rows]
        self.counts = {key: names.count(name) for name, key in self.keys.items()}

    def data(self) -> list[bytes]:
        """Return the records of the data section."""
        if not self.chunked:
            return [self.declared, *self.messages]
        parts = [self.messages[k : k + CHUNK_ROWS] for k in range(0, len(self.messages), CHUNK_ROWS)]
        parts[0] = [self.declared, *parts[0]]
        return [chunk(b"".join(part), how=self.how) for part in parts]

    def summary(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", *item) for item in self.counts.items())
        numbers = struct.pack("<QHIIIIQQ", sum(self.counts.values()), 3, 3, 0, 0, 0, 0, 0)
        return self.declared + record(STATISTICS, numbers + struct.pack("<I", len(counts)) + counts)

    def file(self, data: Sequence[bytes] | None = None, *, checksum: int | None = None) -> bytes:
        """Return the file; checksum: of the data, by default the right one."""
        body = (
            MAGIC + record(HEADER, text("ros2") + text("")) + b"".join(self.data() if data is None else data)
        )
        body += record(DATA_END, struct.pack("<I", zlib.crc32(body) if checksum is None else checksum))
        summary = self.summary()
        footer = struct.pack("<BQQQ", FOOTER, 20, len(body), 0)
        return body + summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + MAGIC


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path
