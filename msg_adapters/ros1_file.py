"""A bag of ROS 1 (version 2.0), read by rosbags and its messages turned into those of ROS 2."""

import bz2
import struct
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from msg_adapters.compression import Allowance
from msg_adapters.contents import Contents
from msg_adapters.topic_map import typestore
from rsea_ros.documents.wording import brief

_PACKED: tuple[tuple[bytes, Callable[[], Any]], ...] = (
    (b"BZh", bz2.BZ2Decompressor),
    (b"\x04\x22\x4d\x18", LZ4FrameDecompressor),
)
"""First bytes of a compressed chunk, and what unpacks it."""
_DAMAGE = (ReaderError, AssertionError, ArithmeticError, EOFError, LookupError, OSError, RuntimeError,
           TypeError, ValueError, struct.error)  # fmt: skip
"""What the reader raises for damaged bytes."""


def scan(path: Path, contents: Contents, allowance: Allowance) -> None:
    """Add all messages of a file to the contents, by log time, up to the first damage, which is reported.

    Messages of a type that ROS 1 Noetic does not have, or has in another version, are left out with a note.
    Raises ValueError for a file that cannot be opened: not indexed after a killed recorder, or damaged.
    """
    try:
        reader = Reader(path)
        reader.open()
    except _DAMAGE as error:
        reindexed = "; rosbag reindex mends a bag of a killed recorder" if "indexed" in str(error) else ""
        raise ValueError(f"no ROS 1 bag that can be read: {brief(str(error))}{reindexed}") from None
    try:
        for position, chunk in reader.chunks.items():
            reader.chunks[position] = chunk._replace(decompressor=partial(_unpacked, allowance=allowance))
        _messages(reader, path, contents)
    finally:
        reader.close()


def _messages(reader: Reader, path: Path, contents: Contents) -> None:
    wanted, read, damaged = {}, 0, 0
    for connection in reader.connections:
        sink = contents.sink(connection.topic, connection.msgtype)
        if sink is not None and _is_known(connection.msgtype, connection.digest):
            wanted[connection.id] = sink
        elif sink is not None:
            contents.notes.append(f"{connection.topic}: {brief(connection.msgtype)} of another version")
    chosen = [connection for connection in reader.connections if connection.id in wanted]
    total = sum(connection.msgcount for connection in chosen)
    try:
        for connection, log_time, data in reader.messages(chosen) if chosen else ():
            read += 1
            try:
                raw = bytes(typestore().ros1_to_cdr(data, connection.msgtype))
            except (SerdeError, *_DAMAGE):
                damaged += 1
                continue
            wanted[connection.id].log_times.append(log_time)
            wanted[connection.id].raw.append(raw)
    except _DAMAGE as error:
        detail = f"{read} of {total} messages read: {brief(str(error) or type(error).__name__)}"
        contents.tell("cut_off", path.name, detail, total - read, "messages", (total - read) / total)
    if damaged:
        detail = "left out: they do not fit their type"
        contents.tell("damaged_messages", path.name, detail, damaged, "messages", damaged / total)


def _unpacked(packed: bytes, allowance: Allowance) -> bytes:
    for start, decompressor in _PACKED:
        if packed.startswith(start):
            plain: bytes = decompressor().decompress(packed, max_length=allowance.left + 1)
            allowance.take(len(plain))
            return plain
    return packed


@cache
def _is_known(msgtype: str, digest: str | None) -> bool:
    """Return whether a type, with the MD5 sum of its definition, is the same in ROS 1 Noetic and in ROS 2."""
    old, new = get_typestore(Stores.ROS1_NOETIC), typestore()
    if msgtype not in old.fielddefs or old.fielddefs[msgtype] != new.fielddefs.get(msgtype):
        return False
    return old.generate_msgdef(msgtype)[1] == digest
