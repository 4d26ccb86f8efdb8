"""Numbers into serialised messages, all messages of a topic at once (the reverse of cdr.py)."""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from msg_adapters.cdr import HEADER
from rsea_ros.records.record import FloatArray, IntArray

LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def joint_states(
    stamps: IntArray,
    name: str,
    position: FloatArray | None = None,
    velocity: FloatArray | None = None,
    effort: FloatArray | None = None,
) -> list[bytes]:
    """Serialise sensor_msgs/JointState of one joint: stamps in ns (n,), rad, rad/s, N m (n,)."""
    table = _Table(stamps)
    table.constant(struct.pack("<I", 1), 4)
    table.text(name)
    for values in (position, velocity, effort):
        table.constant(struct.pack("<I", 0 if values is None else 1), 4)
        if values is not None:
            table.doubles(values[:, None])
    return table.messages()


def wrenches(stamps: IntArray, values: FloatArray, frame: str = "ft_sensor") -> list[bytes]:
    """Serialise geometry_msgs/WrenchStamped: stamps in ns (n,), force N and torque N m (n, 6)."""
    table = _Table(stamps, frame)
    table.doubles(values)
    return table.messages()


class _Table:
    """One row of bytes a message, grown column by column."""

    def __init__(self, stamps: IntArray, frame: str = "") -> None:
        self.count = len(stamps)
        self.width = 0
        self.columns: list[npt.NDArray[np.uint8]] = []
        self.constant(LITTLE_ENDIAN, 1)
        self._numbers((stamps // 1_000_000_000).astype("<i4")[:, None], 4)
        self._numbers((stamps % 1_000_000_000).astype("<u4")[:, None], 4)
        self.text(frame)

    def constant(self, data: bytes, align: int) -> None:
        padding = -(self.width - HEADER) % align
        row = np.frombuffer(bytes(padding) + data, np.uint8)
        self._append(np.broadcast_to(row, (self.count, row.size)))

    def text(self, text: str) -> None:
        data = text.encode() + b"\x00"
        self.constant(struct.pack("<I", len(data)) + data, 4)

    def doubles(self, values: FloatArray) -> None:
        self._numbers(values.astype("<f8"), 8)

    def messages(self) -> list[bytes]:
        data = np.concatenate(self.columns, axis=1).tobytes()
        return [data[at : at + self.width] for at in range(0, len(data), self.width)]

    def _numbers(self, values: npt.NDArray[np.generic], align: int) -> None:
        self.constant(b"", align)
        self._append(np.ascontiguousarray(values).view(np.uint8))

    def _append(self, column: npt.NDArray[np.uint8]) -> None:
        self.columns.append(column)
        self.width += column.shape[1]
