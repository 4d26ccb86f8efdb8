"""Numbers out of and into serialised messages, all messages of a topic at once.

CDR puts a four-byte header before the message and aligns each number to its size, counted from the end
of that header. Messages of one topic nearly always share their layout (frame, names, lengths of the
arrays), so one message is walked and the numbers of all that share its layout are cut out together.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from msg_adapters.topic_map import DYNAMIC, FLOAT, FLOATS, JOINT_STATE, WRENCH, typestore
from rsea_ros.errors import BagError
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
