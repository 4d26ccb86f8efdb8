"""Numbers out of and into one serialised message, without making the message.

rclpy makes a Python object for every part of a message: 250 us for a wrench in a process that has slept for
3 ms. The layout is determined once (cdr.py); while the bytes that define it stay, numbers keep their places.
"""

import math
import struct
from collections.abc import Sequence

from msg_adapters.cdr import SECOND, STAMP, layout_of
from msg_adapters.topic_map import WRENCH
from rsea_ros.documents.wording import brief
from rsea_ros.errors import ParameterError

LONGEST = 65_536
"""Bytes of a message of one joint or one wrench, with long names. A longer one is refused unread: what a
cycle does for a message must not depend on who sends it."""


class RawReader:
    """Reads the stamp (0 of messages without one) and some numbers of the messages of a topic.

    fields: name and index of each number; one that a message does not have is nan.
    joint: name that the joint of a message with names must have; empty: any. Of a message with several
    joints its numbers are read. most: names that a message may have beside that.
    """

    def __init__(
        self, msgtype: str, fields: Sequence[tuple[str, int]], joint: str = "", most: int = 1
    ) -> None:
        self._msgtype, self._fields, self._joint, self._most = msgtype, fields, joint, most
        self._length, self._stamped = -1, True
        self._fixed: list[tuple[int, int, bytes]] = []
        self._stamp, self._double = struct.Struct("<iI"), struct.Struct("<d")
        self._at: list[int] = []

    def read(self, raw: bytes) -> tuple[int, list[float]]:
        """Return the stamp, ns, and the numbers.

        Raises ParameterError for too many joints or another one, a damaged message, one of more than 64 KiB.
        """
        if len(raw) > LONGEST:
            raise ParameterError(f"{len(raw)} bytes, expected at most {LONGEST} of a {self._msgtype}")
        if len(raw) != self._length or any(raw[a:b] != same for a, b, same in self._fixed):
            self._learn(raw)
        seconds, nanoseconds = self._stamp.unpack_from(raw, STAMP) if self._stamped else (0, 0)
        unpack = self._double.unpack_from
        return seconds * SECOND + nanoseconds, [unpack(raw, at)[0] if at else math.nan for at in self._at]

    def _learn(self, raw: bytes) -> None:
        self._length = -1
        try:
            layout = layout_of(raw, self._msgtype)
        except ValueError as error:
            raise ParameterError(f"no {self._msgtype}: {error}") from None
        place = self._place(layout.names)
        for name in {name for name, _ in self._fields if self._msgtype != WRENCH}:
            if (count := layout.fields[name][1]) > max(len(layout.names), self._most):
                raise ParameterError(f"{count} numbers of {name}, expected at most one for each joint")
        places = [(*layout.fields[name], place + index) for name, index in self._fields]
        self._at = [first + 8 * at if at < count else 0 for first, count, at in places]  # 0: not in it
        self._fixed = [(a, b, raw[a:b]) for a, b in layout.structure]
        self._stamp, self._double = (struct.Struct(layout.order + kind) for kind in ("iI", "d"))
        self._length, self._stamped = len(raw), layout.stamped

    def _place(self, joints: Sequence[str]) -> int:
        """Return the place of the joint in a message. Raises ParameterError where it is not, or twice."""
        if len(joints) > self._most:
            if joints.count(self._joint) == 1:
                return joints.index(self._joint)
            names, most = brief(", ".join(joints[:5])), "one" if self._most == 1 else self._most
            expected = f"{self._joint!r} once (parameter joint)" if self._joint else most
            raise ParameterError(f"{len(joints)} joints ({names}), expected {expected}")
        if self._joint and joints and joints[0] != self._joint:
            raise ParameterError(f"joint {joints[0]!r}, expected {self._joint!r} (parameter joint)")
        return 0


class RawWriter:
    """Writes stamp and numbers of some fields into copies of a serialised message."""

    def __init__(self, template: bytes, msgtype: str, *fields: str) -> None:
        layout = layout_of(template, msgtype)
        self._bytes = bytearray(template)
        self._stamp, self._double = (struct.Struct(layout.order + kind) for kind in ("iI", "d"))
        places = (layout.fields[field] for field in fields)
        self._at = [first + 8 * index for first, count in places for index in range(count)]

    def write(self, stamp: int, values: Sequence[float]) -> bytes:
        """Return the message of a stamp (ns) and values in the order of the fields; more are left out."""
        self._stamp.pack_into(self._bytes, STAMP, stamp // SECOND, stamp % SECOND)
        pack = self._double.pack_into
        for at, value in zip(self._at, values, strict=False):
            pack(self._bytes, at, value)
        return bytes(self._bytes)
