"""Numbers out of and into serialised messages, all messages of a topic at once.

CDR puts a four-byte header before the message and aligns each number to its size, counted from the end
of that header. Messages of one topic nearly always share their layout (frame, names, lengths of the
arrays), so one message is walked and the numbers of all that share its layout are cut out together.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from msg_adapters.topics import WRENCH
from rsea_ros.errors import BagError
from rsea_ros.signals import FloatArray, IntArray

ByteMatrix = npt.NDArray[np.uint8]

HEADER = 4
STAMP = 4


@dataclass(frozen=True)
class Layout:
    """Where the numbers of a message lie.

    names: joints. fields: name -> (first byte, count of doubles). order: '<' or '>'.
    structure: positions of the bytes that make the layout (lengths and texts, no padding: padding may
    hold anything).
    """

    names: tuple[str, ...]
    fields: Mapping[str, tuple[int, int]]
    order: str
    structure: tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """Messages of one layout: their indices in the topic (n,) and their bytes (n, length)."""

    rows: IntArray
    matrix: ByteMatrix
    layout: Layout

    def stamps(self) -> IntArray:
        """Return the header stamps, ns, shape (n,)."""
        seconds = self._cut(STAMP, 4, "i4")[:, 0].astype(np.int64)
        nanoseconds = self._cut(STAMP + 4, 4, "u4")[:, 0].astype(np.int64)
        return seconds * 1_000_000_000 + nanoseconds

    def field(self, name: str) -> FloatArray:
        """Return the doubles of a field, shape (n, count)."""
        first, count = self.layout.fields[name]
        return self._cut(first, 8 * count, "f8").astype(np.float64)

    def _cut(self, first: int, length: int, kind: str) -> npt.NDArray[Any]:
        columns = np.ascontiguousarray(self.matrix[:, first : first + length])
        return columns.view(np.dtype(f"{self.layout.order}{kind}"))


class _Walk:
    """A walk through one message that notes which bytes make its layout."""

    def __init__(self, raw: bytes) -> None:
        if raw[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise ValueError(f"encapsulation {raw[:2].hex()!r}, expected plain CDR (0000 or 0001)")
        self.raw = raw
        self.order = "<" if raw[1] else ">"
        self.at = HEADER
        self.structure = [1]

    def _take(self, size: int, align: int) -> int:
        first = HEADER + -(-(self.at - HEADER) // align) * align
        self.at = first + size
        if self.at > len(self.raw):
            raise ValueError(f"{len(self.raw)} bytes, expected at least {self.at}")
        return first

    def count(self) -> int:
        first = self._take(4, 4)
        self.structure.extend(range(first, first + 4))
        return int(struct.unpack_from(f"{self.order}I", self.raw, first)[0])

    def text(self) -> str:
        first = self._take(self.count(), 1)
        self.structure.extend(range(first, self.at))
        return self.raw[first : self.at].rstrip(b"\x00").decode(errors="replace")

    def stamp_and_frame(self) -> None:
        self._take(8, 4)
        self.text()

    def doubles(self, count: int) -> tuple[int, int]:
        return (self._take(8 * count, 8) if count else self.at, count)


def layout_of(raw: bytes, msgtype: str) -> Layout:
    """Walk one serialised JointState or WrenchStamped. Raises ValueError for a damaged message."""
    walk = _Walk(raw)
    walk.stamp_and_frame()
    names: tuple[str, ...] = ()
    if msgtype == WRENCH:
        fields = {"wrench": walk.doubles(6)}
    else:
        names = tuple([walk.text() for _ in range(walk.count())])
        fields = {name: walk.doubles(walk.count()) for name in ("position", "velocity", "effort")}
    return Layout(names, fields, walk.order, tuple(walk.structure))


def blocks(messages: Sequence[bytes], msgtype: str, where: str) -> Iterator[Block]:
    """Sort the messages of a topic by layout.

    Raises BagError for a damaged message; `where` (file and topic) is for its text.
    """
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    for length in np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        joined = b"".join([messages[row] for row in rows.tolist()])
        matrix = np.frombuffer(joined, np.uint8).reshape(rows.size, int(length))
        while rows.size:
            try:
                layout = layout_of(matrix[0].tobytes(), msgtype)
            except ValueError as error:
                raise BagError(f"{where}: message {rows[0]} is no {msgtype}: {error}") from None
            structure = np.array(layout.structure)
            same = (matrix[:, structure] == matrix[0, structure]).all(axis=1)
            yield Block(rows[same], matrix[same], layout)
            rows, matrix = rows[~same], matrix[~same]
