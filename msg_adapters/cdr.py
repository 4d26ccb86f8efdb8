"""Numbers out of and into serialised messages: all of a topic at once, or one without making the message.

CDR puts a four-byte header before the message and aligns each number to its size, counted from the end
of that header. Messages of one topic nearly always share their layout (frame, names, lengths of the
arrays), so one message is walked and the numbers of all that share its layout are cut out together. Of one
message at a time they keep their places while the bytes that define the layout stay: rclpy makes a Python
object for every part of a message, 250 us for a wrench in a process that has slept for 3 ms.
"""

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from msg_adapters.topic_map import DYNAMIC, FLOAT, FLOATS, JOINT_STATE, WRENCH, typestore
from rsea_ros.documents.wording import brief
from rsea_ros.errors import BagError, ParameterError
from rsea_ros.records.record import FloatArray, IntArray

ByteMatrix = npt.NDArray[np.uint8]

SECOND = 1_000_000_000
"""ns."""
HEADER = 4
STAMP = 4
VALUES = "data"
"""The field of a message of numbers without names."""
_MANY = 32
"""Layouts of one length; a topic has one or two of them."""


@dataclass(frozen=True)
class MessageLayout:
    """Where the numbers of a message lie.

    names: joints. fields: name -> (first byte, count of doubles). order: '<' or '>'.
    structure: first and end of the runs of bytes that make the layout: lengths and names. Not the frame,
    which may be any text, and not the padding, which may hold anything.
    end: the first byte behind the message. stamped: whether it begins with a header.
    """

    names: tuple[str, ...]
    fields: Mapping[str, tuple[int, int]]
    order: str
    structure: tuple[tuple[int, int], ...]
    end: int
    stamped: bool = True


@dataclass(frozen=True)
class Block:
    """Messages of one layout: their indices in the topic (n,) and their bytes (n, length)."""

    rows: IntArray
    matrix: ByteMatrix
    layout: MessageLayout

    def stamps(self) -> IntArray:
        """Return the header stamps, ns, shape (n,); zero for messages without a header."""
        if not self.layout.stamped:
            return np.zeros(len(self.rows), np.int64)
        seconds = self._cut(STAMP, 4, "i4")[:, 0].astype(np.int64)
        return seconds * SECOND + self.nanoseconds()

    def nanoseconds(self) -> IntArray:
        """Return the part of the header stamps below a second, ns, shape (n,)."""
        if not self.layout.stamped:
            return np.zeros(len(self.rows), np.int64)
        return self._cut(STAMP + 4, 4, "u4")[:, 0].astype(np.int64)

    def field(self, name: str) -> FloatArray:
        """Return the doubles of a field, shape (n, count)."""
        first, count = self.layout.fields[name]
        return self._cut(first, 8 * count, "f8").astype(np.float64)

    def _cut(self, first: int, length: int, kind: str) -> npt.NDArray[Any]:
        columns = np.ascontiguousarray(self.matrix[:, first : first + length])
        return columns.view(np.dtype(f"{self.layout.order}{kind}"))


class Walk:
    """A walk through one message that notes which bytes make its layout; texts are passed by unread."""

    def __init__(self, raw: bytes) -> None:
        if raw[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise ValueError(f"encapsulation {raw[:2].hex()!r}, expected plain CDR (0000 or 0001)")
        self.raw = raw
        self.order = "<" if raw[1] else ">"
        self.at = HEADER
        self.structure = [(1, 2)]

    def _take(self, size: int, align: int) -> int:
        first = HEADER + -(-(self.at - HEADER) // align) * align
        if first + size > len(self.raw):
            raise ValueError(f"{len(self.raw)} bytes, expected at least {first + size}")
        self.at = first + size
        return first

    def skip(self, size: int) -> None:
        """Pass by some bytes."""
        self._take(size, 1)

    def count(self) -> int:
        """Return a count or length, which is part of the layout."""
        first = self._take(4, 4)
        self.structure.append((first, first + 4))
        return int(struct.unpack_from(f"{self.order}I", self.raw, first)[0])

    def text(self) -> tuple[int, int]:
        """Return first byte and end of a text."""
        first = self._take(self.count(), 1)
        return first, self.at

    def read_text(self) -> str:
        """Return a text; of more than 1000 bytes the first."""
        first, end = self.text()
        return self.raw[first : min(end, first + 1000)].rstrip(b"\x00").decode(errors="replace")

    def stamp_and_frame(self) -> None:
        """Pass by a header."""
        self._take(8, 4)
        self.text()

    def name(self) -> str:
        """Return a name, which is part of the layout."""
        first, end = self.text()
        self.structure[-1] = (first - 4, end)  # with its length
        return self.raw[first:end].rstrip(b"\x00").decode(errors="replace")

    def doubles(self, count: int) -> tuple[int, int]:
        """Return first byte and count of doubles."""
        return (self._take(8 * count, 8) if count else self.at, count)


def layout_of(raw: bytes, msgtype: str) -> MessageLayout:
    """Walk one serialised message of topic_map.READ. Raises ValueError for a damaged message.

    The fields of a DynamicJointState are called `JOINT/INTERFACE`, the one of numbers without names VALUES.
    """
    walk = Walk(raw)
    stamped = msgtype not in (FLOAT, FLOATS)
    if stamped:
        walk.stamp_and_frame()
    names: tuple[str, ...] = ()
    if msgtype == WRENCH:
        fields = {"wrench": walk.doubles(6)}
    elif msgtype == FLOAT:
        fields = {VALUES: walk.doubles(1)}
    elif msgtype == FLOATS:
        for _ in range(walk.count()):
            walk.name()
            walk.count(), walk.count()
        walk.count()
        fields = {VALUES: walk.doubles(walk.count())}
    elif msgtype == DYNAMIC:
        names = tuple([walk.name() for _ in range(walk.count())])
        fields = {}
        for at in range(walk.count()):
            interfaces = [walk.name() for _ in range(walk.count())]
            first, _ = walk.doubles(walk.count())
            joint = names[at] if at < len(names) else ""
            fields |= {f"{joint}/{name}": (first + 8 * k, 1) for k, name in enumerate(interfaces)}
    else:
        names = tuple([walk.name() for _ in range(walk.count())])
        fields = {name: walk.doubles(walk.count()) for name in ("position", "velocity", "effort")}
    return MessageLayout(names, fields, walk.order, tuple(walk.structure), walk.at, stamped)


def blocks(
    messages: Sequence[bytes], msgtype: str, where: str, damaged: dict[int, str] | None = None
) -> Iterator[Block]:
    """Sort the messages of a topic by layout.

    damaged: takes index and reason of each damaged message; they are left out.
    Raises BagError where no message is left; `where` (file and topic) is for its text.
    """
    damaged = {} if damaged is None else damaged
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    order = np.argsort(lengths, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(lengths[order])) + 1):
        if rows.size:
            yield from _of_one_length(messages, rows, msgtype, damaged)
    if damaged and len(damaged) == len(messages):
        first = min(damaged)
        raise BagError(f"{where}: message {first} is no {msgtype}: {damaged[first]}")


def _of_one_length(
    messages: Sequence[bytes], rows: IntArray, msgtype: str, damaged: dict[int, str]
) -> Iterator[Block]:
    """Sort messages of one length by layout: the first ones by comparing bytes, a motley rest one by one."""
    length = len(messages[rows[0]])
    joined = b"".join([messages[row] for row in rows.tolist()])
    matrix = np.frombuffer(joined, np.uint8).reshape(rows.size, length)
    for _ in range(_MANY):
        layout = _layout_or_reason(messages[rows[0]], msgtype)
        same = np.zeros(rows.size, bool)
        if isinstance(layout, str):
            same[0], damaged[int(rows[0])] = True, layout
        else:
            same[:] = True
            for first, end in layout.structure:
                same &= (matrix[:, first:end] == matrix[0, first:end]).all(axis=1)
            yield Block(rows[same], matrix[same], layout)
        rows, matrix = rows[~same], matrix[~same]
        if not rows.size:
            return
    groups: dict[tuple[object, ...], tuple[MessageLayout, list[int]]] = {}
    for place, row in enumerate(rows.tolist()):
        layout = _layout_or_reason(messages[row], msgtype)
        if isinstance(layout, str):
            damaged[row] = layout
        else:
            key = (layout.names, tuple(layout.fields.items()), layout.order)
            groups.setdefault(key, (layout, []))[1].append(place)
    for layout, places in groups.values():
        yield Block(rows[places], matrix[places], layout)


def _layout_or_reason(raw: bytes, msgtype: str) -> MessageLayout | str:
    try:
        return layout_of(raw, msgtype)
    except ValueError as error:
        return str(error)


def joint_states(
    stamps: IntArray, name: str, position: FloatArray | None = None, velocity: FloatArray | None = None,
    effort: FloatArray | None = None,
) -> list[bytes]:  # fmt: skip
    """Serialise sensor_msgs/JointState of one joint: stamps in ns (n,), rad, rad/s, N m (n,)."""
    given = {"position": position, "velocity": velocity, "effort": effort}
    sizes = {field: np.zeros(0 if values is None else 1) for field, values in given.items()}
    columns = {field: values[:, None] for field, values in given.items() if values is not None}
    return _written(JOINT_STATE, stamps, columns, "", name=[name], **sizes)


def wrenches(stamps: IntArray, values: FloatArray) -> list[bytes]:
    """Serialise geometry_msgs/WrenchStamped: stamps in ns (n,), force N and torque N m (n, 6)."""
    zero = typestore().types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    wrench = typestore().types["geometry_msgs/msg/Wrench"](zero, zero)
    return _written(WRENCH, stamps, {"wrench": values}, "ft_sensor", wrench=wrench)


def _written(
    msgtype: str, stamps: IntArray, columns: Mapping[str, FloatArray], frame: str, **content: Any
) -> list[bytes]:
    """Return copies of one message with stamps, ns (n,), and columns by field, (n, count), in them."""
    types = typestore().types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), frame)
    raw = bytes(typestore().serialize_cdr(types[msgtype](header, **content), msgtype))
    matrix = np.tile(np.frombuffer(raw, np.uint8), (len(stamps), 1))
    fields = layout_of(raw, msgtype).fields
    parts = [(fields[name][0], values.astype("<f8")) for name, values in columns.items()]
    parts += [(STAMP, np.column_stack([stamps // SECOND, stamps % SECOND]).astype("<u4"))]
    for first, values in parts:
        data = np.ascontiguousarray(values).view(np.uint8)
        matrix[:, first : first + data.shape[1]] = data
    whole, width = matrix.tobytes(), len(raw)
    return [whole[at : at + width] for at in range(0, len(whole), width)]


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
