"""Simulated drives with the MIT frame, and the adapter before their bus: a serial line of text (slcan)."""

import os
import struct
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from rsea_ros.hardware.peer.peer_motor import KEPT, EmulatedMotor, Mechanism
from rsea_ros.hardware.peer.registers import ENCODER
from rsea_ros.hardware.peer.serial_line import EmulatedBus

TICK = 50_000
"""ns; unit of the drives' time-out."""
LOST = 13
"""Damiao's error after a time-out."""
PARAMETERS = {0x7005: "control_mode", 0x700B: "torque_limit", 0x7028: "timeout"}
REGISTERS = {2: "hot", 9: "timeout", 10: "control_mode", 14: "firmware", 21: "p", 22: "v", 23: "t"}
FLOATS = {"torque_limit", "hot", "p", "v", "t"}


class Model(NamedTuple):
    """p rad, v rad/s, t N m: its ranges, either way. times_out: whether it has a time-out of its own."""

    family: str
    p: float
    v: float
    t: float
    times_out: bool = False


DRIVES = {
    "AK80-9": Model("ak", 12.5, 50.0, 18.0), "AK10-9": Model("ak", 12.5, 50.0, 65.0),
    "mini-cheetah": Model("mini", 12.5, 65.0, 18.0),
    "DM4310": Model("dm", 12.5, 30.0, 10.0, True), "DM8009": Model("dm", 12.5, 45.0, 54.0, True),
    "RS02": Model("rs", 12.566371, 44.0, 17.0, True), "RS03": Model("rs", 12.566371, 20.0, 60.0, True),
    "CyberGear": Model("rs", 12.566371, 30.0, 12.0),
}  # fmt: skip
Message = tuple[int, bool, bytes]
"""Identifier, whether it has 29 bits, data."""


class EmulatedDrive(EmulatedMotor):
    """One drive. Its items: id, host, torque_enable, hardware_error (code or bits of its family), temperature
    °C, origin mrad, control_mode, timeout, torque_limit, number, and the ranges p, v, t that it is set to.

    `history` has N mm of the commanded torque, 0 where that is next to zero, which no count is.
    """

    def __init__(self, name: str, plant: Mechanism, kept: int = KEPT) -> None:
        self._plant, self._touched, self.sign, self.model = plant, 0, 1, ENCODER
        self.history: deque[tuple[int, int, bool]] = deque(maxlen=kept)
        self.kind = model = DRIVES[name]
        self._items: dict[str, float] = {
            "id": 1, "host": 0xFD if model.family == "rs" else 0, "torque_enable": 0, "hardware_error": 0,
            "temperature": 32, "voltage": 240, "origin": 300, "timeout": 0, "return_delay": 0,
            "control_mode": int(model.family == "dm"), "torque_limit": model.t, "number": 0x1122334455667788,
            "p": model.p, "v": model.v, "t": model.t, "hot": 100.0, "firmware": 5001,
        }  # fmt: skip
        self._command = (0.0,) * 5

    def get(self, name: str) -> int:
        """Return an item, as a whole number."""
        return int(self._items[name])

    def put(self, name: str, value: float) -> None:
        """Set an item without the rules for hosts."""
        if name not in self._items:
            raise KeyError(name)
        self._items[name] = value

    def serve(self, now: int) -> None:
        """Look after the time-out, and let stiffness and damping act."""
        on, limit = self.get("torque_enable"), self.get("timeout")
        if on and limit and self.kind.times_out and now - self._touched > limit * TICK:
            self.put("torque_enable", 0)
            if self.kind.family == "dm":
                self.put("hardware_error", LOST)
            self._act(now)
        elif on and any(self._command[2:4]):
            self._plant.write(self.sign * self.torque())

    def shut_down(self, now: int, bits: int) -> None:
        """Set its error, which takes the torque away until it is cleared."""
        self.put("hardware_error", bits)
        self.put("torque_enable", 0)
        self._act(now)

    def torque(self) -> float:
        """Return the torque that acts, N m."""
        p, v, kp, kd, t = self._command
        if not self.get("torque_enable"):
            return 0.0
        position, velocity, _ = self._motion()
        torque = kp * (p - position - 1e-3 * self._items["origin"]) + kd * (v - velocity) + t
        return max(-self._items["t"], min(self._items["t"], torque))

    def acting_goal(self) -> int:
        """Return the torque of the command in N mm, 0 for the least that a frame can say, and when off."""
        least = 1.01 * self._items["t"] / (65535 if self.kind.family == "rs" else 4095)
        torque = self._command[4]
        return 0 if abs(torque) < least or not self.get("torque_enable") else round(1e3 * torque)

    def hear(self, now: int, message: Message) -> list[Message]:
        """Obey a message, and return the answers."""
        identity, extended, data = message
        if extended != (self.kind.family == "rs"):
            return []
        if extended:
            return self._hear_extended(now, identity, data) if identity & 0xFF == self.get("id") else []
        if identity == 0x7FF and self.kind.family == "dm" and data[:2] == bytes((self.get("id"), 0)):
            return self._hear_register(now, data)
        if identity != self.get("id") or len(data) != 8:
            return []
        self._touched = now
        before = self._state()
        if data[:7] == b"\xff" * 7 and data[7] >= 0xFB:
            self._obey({0xFB: "clear", 0xFC: "on", 0xFD: "off", 0xFE: "zero"}.get(data[7], ""), now)
        else:
            whole = int.from_bytes(data, "big")
            counts = [whole >> 48, *(whole >> shift & 0xFFF for shift in (36, 24, 12, 0))]
            self._take(now, counts, (16, 12, 12, 12, 12))
        return [(self.get("host"), False, self._state() if self.kind.family == "dm" else before)]

    def _hear_extended(self, now: int, identity: int, data: bytes) -> list[Message]:
        self._touched, kind, middle = now, identity >> 24, identity >> 8 & 0xFFFF
        own, host = self.get("id"), self.get("host")
        index = PARAMETERS.get(int.from_bytes(data[:2], "little"), "") if kind in (17, 18) else ""
        if kind == 0:
            return [(own << 8 | 0xFE, True, self.get("number").to_bytes(8, "little"))]
        if kind == 17:
            known = index and (index != "timeout" or self.kind.times_out)
            answer = data[:4] + self._packed(index)
            return [(17 << 24 | own << 8 | host, True, answer)] if known else []
        if kind == 18 and index:
            self._items[index] = self._unpacked(index, data[4:8])
        elif kind == 1:
            self._take(now, [*struct.unpack(">4H", data), middle], (16,) * 5)
        else:
            self._obey({3: "on", 4: "clear" if data[0] else "off", 6: "zero"}.get(kind, ""), now)
        bits = self.get("hardware_error") & 0x3F
        state = (2 if self.get("torque_enable") else 0) << 22 | bits << 16
        return [(2 << 24 | state | own << 8 | host, True, self._state())]

    def _hear_register(self, now: int, data: bytes) -> list[Message]:
        self._touched, name = now, REGISTERS.get(data[3], "")
        if data[2] == 0x55 and name:
            self._items[name] = self._unpacked(name, data[4:8])
        return [(self.get("host"), False, data[:4] + self._packed(name))] if name else []

    def _obey(self, wish: str, now: int) -> None:
        if wish == "on" and not self.get("hardware_error"):
            self.put("torque_enable", 1)
        elif wish in ("off", "clear"):
            self.put("torque_enable", 0)  # the worst that a drive may do is to keep its command
            if wish == "clear":
                self.put("hardware_error", 0)
        elif wish == "zero":
            self.put("origin", -1e3 * self._motion()[0])
        self._act(now)

    def _take(self, now: int, counts: Sequence[int], bits: Sequence[int]) -> None:
        """Take a command: position, velocity, stiffness, damping, torque; for later where it is off."""
        high = self._items["p"], self._items["v"], 500.0, 5.0, self._items["t"]
        low = -high[0], -high[1], 0.0, 0.0, -high[4]
        self._command = tuple(
            least + (most - least) * count / (2**size - 1)
            for count, size, least, most in zip(counts, bits, low, high, strict=True)
        )  # fmt: skip
        self._act(now)

    def _state(self) -> bytes:
        """Return the data of a reading, packed as the firmware does: cut off, not rounded."""
        position, velocity, torque = self._motion()
        p, v, t = (self._items[name] for name in "pvt")
        whole = int((position + 1e-3 * self._items["origin"] + p) * 65535 / (2 * p) // 1)
        if self.kind.family == "rs":
            counts = [whole % 65535, _cut(velocity, v, 65535), _cut(torque, t, 65535)]
            return struct.pack(">4H", *counts, 10 * self.get("temperature"))
        counts = [whole % 65536, _cut(velocity, v, 4095), _cut(torque, t, 4095)]
        if self.kind.family == "dm":
            counts[0] = max(0, min(65535, whole))
        packed = (counts[0] << 24 | counts[1] << 12 | counts[2]).to_bytes(5, "big")
        warm, error = self.get("temperature"), self.get("hardware_error")
        if self.kind.family == "dm":
            head = (error or self.get("torque_enable")) << 4 | self.get("id")
            return bytes((head, *packed, warm, warm))
        rest = bytes((warm + 40, error)) if self.kind.family == "ak" else b""
        return bytes((self.get("id"), *packed)) + rest

    def _packed(self, name: str) -> bytes:
        if not name:
            return b""
        is_float = name in FLOATS
        return struct.pack("<f", self._items[name]) if is_float else struct.pack("<I", self.get(name))

    @staticmethod
    def _unpacked(name: str, data: bytes) -> float:
        return float(struct.unpack("<f" if name in FLOATS else "<I", data)[0])


def _cut(value: float, most: float, top: int) -> int:
    return max(0, min(top, int((value + most) * top / (2 * most))))


class EmulatedCan(EmulatedBus):
    """The adapter's serial line: `t` and `T` are frames, `O` and `C` open and close the bus."""

    _text, _is_open = b"", False

    def serve(self, now: int) -> None:
        """Read the host's lines, and let the drives answer."""
        with suppress(OSError):
            self._text += os.read(self.descriptor, 4096)
        *lines, self._text = self._text.split(b"\r")
        for line in lines:
            if line[:1] in (b"O", b"C"):
                self._is_open = line[:1] == b"O"
            elif self._is_open and line[:1] in (b"t", b"T"):
                width = 4 if line[:1] == b"t" else 9
                message = int(line[1:width], 16), line[:1] == b"T", bytes.fromhex(line[width + 1 :].decode())
                for drive in self._motors:
                    assert isinstance(drive, EmulatedDrive)
                    for reply in drive.hear(now, message):
                        self._reply_to(now, drive, reply)
        self.flush(now)

    def _reply_to(self, now: int, drive: EmulatedMotor, reply: Message) -> None:
        """Send a reply, and its twin's; what is damaged on a bus is not delivered."""
        identity, extended, data = reply
        lost = [kind for kind in ("silent", "drop", "corrupt", "truncate", "wrong_crc")
                if self._wrong.happens(kind)]  # fmt: skip
        if lost:
            return
        name = f"T{identity:08X}" if extended else f"t{identity:03X}"
        packet = f"{name}{len(data)}{data.hex().upper()}\r".encode()
        when = now + (round(self._wrong.late * 1e9) if self._wrong.happens("delay") else 0)
        when = max([when, *(before for before, _ in self._waiting)])  # nothing overtakes on a bus
        self._waiting += [(when, packet)] * (2 if self._wrong.happens("twin") else 1)
        self.sent.append((now, identity, data))
