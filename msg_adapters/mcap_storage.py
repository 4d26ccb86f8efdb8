"""MCAP files written in chunks that are safe as soon as they are flushed.

Format: https://mcap.dev/spec. The writer of rosbags keeps a chunk in memory until it holds 1 MiB, which is
ten seconds of an actuator's topics: too much to lose with a recorder that is killed.
"""

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from msg_adapters import mcap_file as mcap
from msg_adapters.contents import REMARKS
from msg_adapters.topic_map import definition
from rsea_ros.outputs.files import create, write_at
from rsea_ros.records.record import IntArray

CHUNK_SIZE = 1 << 20
MESSAGE_RECORD = struct.Struct("<BQHIQQ")
MESSAGE_RECORDS = np.dtype("<u1, <u8, <u2, <u4, <u8, <u8")
"""The same for many messages at once."""
PLACE = struct.Struct("<QQ")
"""Log time and offset of a message in its chunk."""


class McapStorage:
    """One MCAP file being written (see writing.STORAGES)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = create(path)
        self._end = 0
        self._chunk = bytearray()
        self._index: dict[int, bytearray] = {}
        self._span: tuple[int, int] | None = None
        self._types: dict[str, int] = {}
        self._schemas = b""
        self._channels = b""
        self._chunks: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._times: list[int] = []
        self._remarks = 0
        self._put(mcap.MAGIC + _record(mcap.HEADER, _text("ros2"), _text("rsea_ros")))

    def add(self, topic: str, msgtype: str, offered: str = "[]") -> int:
        """Declare a topic with the offered QoS as YAML; return its key."""
        if msgtype not in self._types:
            schema = self._types[msgtype] = len(self._types) + 1
            text, _ = definition(msgtype)
            parts = (struct.pack("<H", schema), _text(msgtype), _text("ros2msg" if text else ""), _text(text))
            self._schemas += (record := _record(mcap.SCHEMA, *parts))
            self._chunk += record
        key = len(self._counts) + 1
        self._counts[key] = 0
        qos = _text("offered_qos_profiles") + _text(offered)
        head = struct.pack("<HH", key, self._types[msgtype])
        record = _record(mcap.CHANNEL, head, _text(topic), _text("cdr"), _with_size(qos))
        self._channels += record
        self._chunk += record
        return key

    def write(self, key: int, log_time: int, raw: bytes) -> None:
        """Append a serialised message."""
        self._index.setdefault(key, bytearray()).extend(PLACE.pack(log_time, len(self._chunk)))
        self._extend_span(log_time, log_time)
        self._chunk += MESSAGE_RECORD.pack(mcap.MESSAGE, 22 + len(raw), key, 0, log_time, log_time) + raw
        if len(self._chunk) >= CHUNK_SIZE:
            self.flush()

    def write_all(self, keys: IntArray, log_times: IntArray, raws: Sequence[bytes]) -> None:
        """Append serialised messages; keys, log_times: shape (n,)."""
        sizes = np.fromiter(map(len, raws), np.int64, len(raws)) + MESSAGE_RECORD.size
        ends = np.cumsum(sizes)
        heads = _message_heads(keys, log_times, sizes)
        first = 0
        while first < len(raws):
            start = len(self._chunk) - ends[first] + sizes[first]
            stop = min(int(np.searchsorted(start + ends, CHUNK_SIZE)) + 1, len(raws))
            part = slice(first, stop)
            places = np.column_stack((log_times[part], (start + ends - sizes)[part])).astype("<u8")
            for key in np.unique(keys[part]):
                self._index.setdefault(int(key), bytearray()).extend(places[keys[part] == key].tobytes())
            self._extend_span(int(log_times[part].min()), int(log_times[part].max()))
            self._chunk += b"".join(chain.from_iterable(zip(heads[part], raws[part], strict=True)))
            if len(self._chunk) >= CHUNK_SIZE:
                self.flush()
            first = stop

    def _extend_span(self, first: int, last: int) -> None:
        known = self._span or (first, last)
        self._span = (min(known[0], first), max(known[1], last))

    def flush(self) -> None:
        """Write the chunk. Interrupted before its end, it is written again at the same place."""
        if not self._chunk:
            return
        span = self._span or (0, 0)
        head = mcap.CHUNK_HEAD.pack(*span, len(self._chunk), zlib.crc32(self._chunk))
        length = struct.pack("<Q", len(self._chunk))
        chunk = _record(mcap.CHUNK, head, _text(""), length, self._chunk)
        indices, offsets = b"", b""
        for key, places in sorted(self._index.items()):
            offsets += struct.pack("<HQ", key, self._end + len(chunk) + len(indices))
            indices += _record(mcap.MESSAGE_INDEX, struct.pack("<H", key), _with_size(places))
        place = struct.pack("<QQQQ", *span, self._end, len(chunk))
        sizes = (struct.pack("<Q", len(indices)), _text(""), length, length)
        self._put(chunk + indices)
        self._chunks.append(_record(mcap.CHUNK_INDEX, place, _with_size(offsets), *sizes))
        for key, places in self._index.items():
            self._counts[key] += len(places) // PLACE.size
        self._times += self._span or ()
        self._chunk, self._index, self._span = bytearray(), {}, None

    def remark(self, texts: Mapping[str, str], known: str) -> None:
        """Keep texts by name in a metadata record."""
        self.flush()
        if texts:
            self._remarks += 1
            pairs = b"".join(_text(name) + _text(text) for name, text in texts.items())
            self._put(_record(mcap.METADATA, _text(REMARKS), _with_size(pairs)))

    def close(self) -> None:
        """Write the rest and the summary."""
        self.flush()
        data_end = _record(mcap.DATA_END, bytes(4))
        summary = self._schemas + self._channels + b"".join(self._chunks) + self._statistics()
        footer = _record(mcap.FOOTER, mcap.FOOTER_CONTENT.pack(self._end + len(data_end), 0, 0))
        self._put(data_end + summary + footer + mcap.MAGIC)
        self.abort()

    def sync(self) -> None:
        """Wait until flushed data are on the disk."""
        os.fsync(self._file)

    def abort(self) -> None:
        """Close the file; flushed data stay."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _statistics(self) -> bytes:
        times = self._times or [0]
        declared = (sum(self._counts.values()), len(self._types), len(self._counts))
        numbers = (*declared, 0, self._remarks, len(self._chunks))
        counts = b"".join(struct.pack("<HQ", key, count) for key, count in self._counts.items())
        head = mcap.STATISTICS_HEAD.pack(*numbers, min(times), max(times))
        return _record(mcap.STATISTICS, head, _with_size(counts))

    def _put(self, data: bytes) -> None:
        """Write at the end. The end moves only when all is written, so that a second try mends the first."""
        write_at(self._file, data, self._end)
        self._end += len(data)


def _record(opcode: int, *parts: bytes | bytearray) -> bytes:
    content = b"".join(parts)
    return mcap.RECORD.pack(opcode, len(content)) + content


def _message_heads(keys: IntArray, log_times: IntArray, sizes: IntArray) -> list[bytes]:
    """Return what precedes each message; sizes: B, with what precedes; each shape (n,)."""
    heads = np.zeros(len(keys), MESSAGE_RECORDS)
    columns = (mcap.MESSAGE, sizes - mcap.RECORD.size, keys, 0, log_times, log_times)
    for name, column in zip(heads.dtype.names or (), columns, strict=True):
        heads[name] = column
    width, data = MESSAGE_RECORDS.itemsize, heads.tobytes()
    return [data[at : at + width] for at in range(0, len(data), width)]


def _with_size(data: bytes | bytearray) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _with_size(text.encode())
