"""Frames of the drives, packed and read, and the tables of their ranges, states and errors. No bus, no clock.

A command has position, velocity, stiffness, damping and torque; here stiffness and damping are always 0, so
that the torque alone acts. A range ±R in b bits has the value R (2 k / (2^b - 1) - 1) at count k: there is no
count for 0, and zero torque is R / (2^b - 1).
"""

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import quote
from rsea_ros.errors import ParameterError

FOLDER = Path(__file__).with_name("models")
RANGES, CODES = ("position", "velocity", "torque"), ("states", "errors")


@dataclass(frozen=True)
class DriveTable:
    """A model. position rad, velocity rad/s, torque N m: the ranges of its frames, either way.

    layout: standard (11-bit identifiers) or extended. host: identifier of the replies. ids: the least and
    largest that the protocol has room for. wraps: counts after which the angle begins anew, 0: not known.
    head: whether byte 0 of a reply is a state and an ID. replies: own where they may have the motor's ID.
    temperatures: byte and °C at a count of 0 of each; temperature: °C a count. error_byte: of the error code.
    states, errors: by code, in extended frames errors by bit. clear: what ends an error.
    registers: index and type. mode: that of the MIT frame. watchdog_unit: s.
    """

    name: str
    family: str
    layout: str
    host: int
    ids: Sequence[int]
    wraps: int
    position: float
    velocity: float
    torque: float
    head: str = ""
    replies: str = ""
    temperatures: Sequence[Sequence[int]] = ()
    temperature: float = 1.0
    error_byte: int = -1
    states: Mapping[int, str] = field(default_factory=dict)
    errors: Mapping[int, str] = field(default_factory=dict)
    clear: int = 0
    registers: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    mode: int = 0
    watchdog_unit: float = math.nan

    @property
    def on(self) -> str:
        """The state in which there is torque; empty where replies tell none."""
        return self.states[max(self.states)] if self.states else ""


def _families() -> dict[str, dict[str, Any]]:
    return {path.stem: dict(strict_yaml.read(path).content) for path in sorted(FOLDER.glob("*.yaml"))}


def drive_table(model: str) -> DriveTable:
    """Return the table of a model, or of a YAML file with a family and ranges.

    Raises ParameterError for a model that nobody knows and a file that does not fit.
    """
    families = _families()
    if model.endswith((".yaml", ".yml")):
        body = dict(strict_yaml.read(Path(model)).content)
        family = str(body.pop("family", ""))
        if family not in families or sorted(body) != sorted(RANGES):
            expected = f"family ({', '.join(families)}), {', '.join(RANGES)}"
            raise ParameterError(f"parameter can_model = {quote(model)}, expected a file with {expected}")
        return _table(Path(model).stem, family, families[family], body)
    for family, content in families.items():
        if model in content["models"]:
            return _table(model, family, content, content["models"][model])
    known = ", ".join(name for content in families.values() for name in content["models"])
    raise ParameterError(f"parameter can_model = {quote(model)}, expected one of {known}, or a YAML file")


def _table(name: str, family: str, content: Mapping[str, Any], ranges: Mapping[str, float]) -> DriveTable:
    given: dict[str, Any] = {key: float(ranges[key]) for key in RANGES}
    given |= {key: value for key, value in content.items() if key != "models"}
    codes = {key: {int(code): word for code, word in content.get(key, {}).items()} for key in CODES}
    return DriveTable(name=name, family=family, **given | codes)


CONTROL, FEEDBACK, ENABLE, STOP, READ, WRITE, REPORT = 1, 2, 3, 4, 17, 18, 21
"""Kinds of an extended frame."""
EVERYBODY, ASK, TELL = 0x7FF, 0x33, 0x55
"""Identifier and codes of a standard frame that reads and writes registers."""
SWITCHES = {ENABLE: 0xFC, STOP: 0xFD}
"""Codes of a standard frame."""


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
        return self._switch(ENABLE)

    def disable(self) -> Frame:
        """Return what switches the torque off; it is answered by a reading, and reads a drive that is off."""
        return self._switch(STOP)

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
        return lambda frame: _number(frame.data[4:8], kind) if self._tells(frame, index) else None

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

    def _switch(self, kind: int) -> Frame:
        return self._code(SWITCHES[kind])

    def _code(self, code: int) -> Frame:
        return Frame(self.identity, bytes((0xFF,) * 7 + (code,)))

    def _register(self, code: int, index: int, number: int = 0) -> Frame:
        return Frame(EVERYBODY, struct.pack("<HBBI", self.identity, code, index, number))

    def _tells(self, frame: Frame, index: int) -> bool:
        """Return whether a frame has the value of a register."""
        asked = frame.data[:4] == self._register(ASK, index).data[:4]
        return asked and frame.identity in self._replies and not frame.extended


class ExtendedFrames(Frames):
    """Frames with the kind, the sender and part of the values in an identifier of 29 bits: RobStride."""

    tell_is_answered = 1

    def __init__(self, table: DriveTable, identity: int, host: int = -1) -> None:
        super().__init__(table, identity, host)
        self._still = count(0.0, 1.0, 16) << 48 | count(0.0, 1.0, 16) << 32

    def command(self, torque: float) -> Frame:
        return self._frame(CONTROL, self._still.to_bytes(8, "big"), count(torque, self.table.torque, 16))

    def clear(self) -> Frame:
        """Return what ends an error, and the torque."""
        return self._frame(STOP, bytes((1, 0, 0, 0, 0, 0, 0, 0)))

    def identify(self) -> Frame:
        """Return what asks for the number of the drive's processor."""
        return self._frame(0)

    def unique(self, frame: Frame) -> str | None:
        """Return the number of the drive's processor, None from another frame."""
        fits = frame.extended and frame.identity >> 24 == 0 and frame.identity >> 8 & 0xFFFF == self.identity
        return frame.data.hex() if fits else None

    def feedback(self, frame: Frame) -> Feedback | None:
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

    def _switch(self, kind: int) -> Frame:
        return self._frame(kind)

    def _register(self, code: int, index: int, number: int = 0) -> Frame:
        return self._frame(READ if code == ASK else WRITE, struct.pack("<HHI", index, 0, number))

    def _tells(self, frame: Frame, index: int) -> bool:
        return self._is_ours(frame, READ) and frame.data[:2] == index.to_bytes(2, "little")

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
