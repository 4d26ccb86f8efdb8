"""Frames of the drives, packed and read. No bus, no clock.

A command has position, velocity, stiffness, damping and torque; here stiffness and damping are always 0, so
that the torque alone acts. A range ±R in b bits has the value R (2 k / (2^b - 1) - 1) at count k: there is no
count for 0, and zero torque is R / (2^b - 1).
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from rsea_ros.hardware.mit_can.tables import DriveTable

CONTROL, FEEDBACK, ENABLE, STOP, READ, WRITE, REPORT = 1, 2, 3, 4, 17, 18, 21
"""Kinds of an extended frame."""
EVERYBODY, ASK, TELL = 0x7FF, 0x33, 0x55
"""Identifier and codes of a standard frame that reads and writes registers."""
ON, OFF = 0xFC, 0xFD


class Frame(NamedTuple):
    """Identifier, up to 8 bytes, and whether the identifier has 29 bits instead of 11."""

    identity: int
    data: bytes
    extended: bool = False


@dataclass(frozen=True)
class Feedback:
    """A reading: counts of the angle, rad/s, N m, °C (nan: not told), state (empty: not told), errors."""

    counts: int
    velocity: float
    torque: float
    temperature: float = math.nan
    state: str = ""
    error: str = ""


def count(value: float, most: float, bits: int) -> int:
    """Return the count nearest to a value, which is cut to the range ±most."""
    return round((min(max(value, -most), most) / most + 1.0) * ((1 << bits) - 1) / 2)


def value(counts: int, most: float, bits: int) -> float:
    """Return the value of a count in the range ±most."""
    return most * (2 * counts / ((1 << bits) - 1) - 1.0)


class Frames:
    """Frames of one drive. Standard identifiers: CubeMars, Damiao, mini-cheetah.

    tell_is_answered: the readings that the writing of a register is answered by.
    """

    tell_is_answered = 0

    def __init__(self, table: DriveTable, identity: int, host: int = -1) -> None:
        self.table, self.identity = table, identity
        self.host = table.host if host < 0 else host
        self._replies = {self.host, identity} if table.replies == "own" else {self.host}
        self._still = count(0.0, 1.0, 16) << 48 | count(0.0, 1.0, 12) << 36

    def command(self, torque: float) -> Frame:
        """Return the command of a torque alone (N m)."""
        return Frame(self.identity, (self._still | count(torque, self.table.torque, 12)).to_bytes(8, "big"))

    def enable(self) -> Frame:
        """Return what switches the torque on."""
        return self._code(ON)

    def disable(self) -> Frame:
        """Return what switches the torque off; it is answered by a reading, and reads a drive that is off."""
        return self._code(OFF)

    def clear(self) -> Frame | None:
        """Return what ends an error; None where the protocol has nothing."""
        return self._code(self.table.clear) if self.table.clear else None

    def identify(self) -> Frame | None:
        """Return what asks for a number that no other drive has; None where the protocol has nothing."""
        return None

    def ask(self, register: str) -> Frame:
        """Return what asks for a register."""
        return self._register(ASK, self.table.registers[register][0])

    def tell(self, register: str, number: int) -> Frame:
        """Return what writes a whole number to a register."""
        return self._register(TELL, self.table.registers[register][0], number)

    def answer(self, register: str) -> Callable[[Frame], float | None]:
        """Return what takes the value of a register from a frame, None from another one."""
        index, kind = self.table.registers[register]
        start = self._register(ASK, index).data[:4]

        def take(frame: Frame) -> float | None:
            fits = frame.identity in self._replies and not frame.extended and frame.data[:4] == start
            return _number(frame.data[4:8], kind) if fits else None

        return take

    def unique(self, frame: Frame) -> str | None:
        """Return the answer to `identify`, None from another frame."""
        return None

    def feedback(self, frame: Frame) -> Feedback | None:
        """Return the reading in a frame of this drive, None in another frame."""
        table, data = self.table, frame.data
        if frame.extended or frame.identity not in self._replies or len(data) < 6:
            return None
        own, code = (data[0] & 0xF, data[0] >> 4) if table.head else (data[0], 0)
        is_register = table.registers and not code and data[1] == 0 and data[2] in (ASK, TELL)
        if own != self.identity or is_register:
            return None
        packed = int.from_bytes(data[1:6], "big")
        felt = [data[at] + zero for at, zero in table.temperatures if at < len(data)]
        if 0 <= table.error_byte < len(data):
            code = data[table.error_byte]
        told = table.states.get(code, "")
        return Feedback(
            counts=packed >> 24,
            velocity=value(packed >> 12 & 0xFFF, table.velocity, 12),
            torque=value(packed & 0xFFF, table.torque, 12),
            temperature=float(max(felt)) if felt else math.nan,
            state=told,
            error="" if told or not code else table.errors.get(code, f"error {code}"),
        )

    def acknowledgements(self) -> list[tuple[Frame, int]]:
        """Return how the answers to `disable` begin, and how many bytes they have."""
        starts = [Frame(reply, bytes((self.identity,))) for reply in sorted(self._replies)]
        return [(start, size) for start in starts for size in (6, 8)]

    def _code(self, code: int) -> Frame:
        return Frame(self.identity, bytes((0xFF,) * 7 + (code,)))

    def _register(self, code: int, index: int, number: int = 0) -> Frame:
        return Frame(EVERYBODY, struct.pack("<HBBI", self.identity, code, index, number))


class ExtendedFrames(Frames):
    """Frames with the kind, the sender and part of the values in an identifier of 29 bits: RobStride."""

    tell_is_answered = 1

    def __init__(self, table: DriveTable, identity: int, host: int = -1) -> None:
        super().__init__(table, identity, host)
        self._still = count(0.0, 1.0, 16) << 48 | count(0.0, 1.0, 16) << 32

    def command(self, torque: float) -> Frame:
        """Return the command of a torque alone (N m)."""
        return self._frame(CONTROL, self._still.to_bytes(8, "big"), count(torque, self.table.torque, 16))

    def enable(self) -> Frame:
        """Return what switches the torque on."""
        return self._frame(ENABLE)

    def disable(self) -> Frame:
        """Return what switches the torque off; it is answered by a reading, and reads a drive that is off."""
        return self._frame(STOP)

    def clear(self) -> Frame:
        """Return what ends an error, and the torque."""
        return self._frame(STOP, bytes((1, 0, 0, 0, 0, 0, 0, 0)))

    def identify(self) -> Frame:
        """Return what asks for the number of the drive's processor."""
        return self._frame(0)

    def ask(self, register: str) -> Frame:
        """Return what asks for a register."""
        return self._frame(READ, struct.pack("<HHI", self.table.registers[register][0], 0, 0))

    def tell(self, register: str, number: int) -> Frame:
        """Return what writes a whole number to a register."""
        return self._frame(WRITE, struct.pack("<HHI", self.table.registers[register][0], 0, number))

    def answer(self, register: str) -> Callable[[Frame], float | None]:
        """Return what takes the value of a register from a frame, None from another one."""
        index, kind = self.table.registers[register]

        def take(frame: Frame) -> float | None:
            fits = self._is_ours(frame, READ) and frame.data[:2] == index.to_bytes(2, "little")
            return _number(frame.data[4:8], kind) if fits else None

        return take

    def unique(self, frame: Frame) -> str | None:
        """Return the number of the drive's processor, None from another frame."""
        fits = frame.extended and frame.identity >> 24 == 0 and frame.identity >> 8 & 0xFFFF == self.identity
        return frame.data.hex() if fits else None

    def feedback(self, frame: Frame) -> Feedback | None:
        """Return the reading in a frame of this drive, None in another frame."""
        table, bits = self.table, frame.identity >> 16 & 0x3F
        if not self._is_ours(frame, FEEDBACK):
            return None
        counts, velocity, torque, temperature = struct.unpack(">4H", frame.data)
        return Feedback(
            counts=counts,
            velocity=value(velocity, table.velocity, 16),
            torque=value(torque, table.torque, 16),
            temperature=temperature * table.temperature,
            state=table.states.get(frame.identity >> 22 & 3, "unknown"),
            error=", ".join(name for bit, name in table.errors.items() if bits >> bit & 1),
        )

    def acknowledgements(self) -> list[tuple[Frame, int]]:
        """Return how the answers to `disable` begin, without an error, and how many bytes they have."""
        return [(Frame(FEEDBACK << 24 | self.identity << 8 | self.host, b"", True), 8)]

    def _is_ours(self, frame: Frame, kind: int) -> bool:
        sender = frame.identity & 0xFF == self.host and frame.identity >> 8 & 0xFF == self.identity
        return frame.extended and frame.identity >> 24 == kind and sender and len(frame.data) == 8

    def _frame(self, kind: int, data: bytes = bytes(8), middle: int = -1) -> Frame:
        middle = self.host if middle < 0 else middle
        return Frame(kind << 24 | middle << 8 | self.identity, data, True)


def _number(data: bytes, kind: str) -> float:
    return float(struct.unpack("<f", data)[0]) if kind == "float" else int.from_bytes(data, "little")


def frames_of(table: DriveTable, identity: int, host: int = -1) -> Frames:
    """Return the frames of a drive by its table. host: identifier of its replies, -1: the table's."""
    return (ExtendedFrames if table.layout == "extended" else Frames)(table, identity, host)
