"""The motor's end of the serial line: a pseudo-terminal that answers every instruction of Protocol 2.0.

The protocol as the motor sees it, written apart from the driver's codec: bit by bit, byte by byte.
"""

import os
import secrets
import tty
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from rsea_ros.hardware.peer.ft import Misbehaviour
from rsea_ros.hardware.peer.peer_motor import KEPT, LENGTH, UNKNOWN, EmulatedMotor
from rsea_ros.outputs.files import PREFIX

PREAMBLE = (0xFF, 0xFF, 0xFD, 0x00)


class Request(NamedTuple):
    """An instruction packet: to whom, what, with which parameters; whole: CRC and stuffing are right."""

    identity: int
    instruction: int
    parameters: bytes
    whole: bool = True


def checksum(data: bytes) -> int:
    """Return the remainder of the bytes, as one long number, modulo x^16 + x^15 + x^2 + 1."""
    register = 0
    for byte in data:
        register = _remainder(register >> 8 ^ byte) ^ (register & 255) << 8
    return register


@cache
def _remainder(byte: int) -> int:
    """Return the remainder of byte · x^16."""
    rest = byte << 16
    for bit in range(23, 15, -1):
        if rest >> bit & 1:
            rest ^= 0x18005 << bit - 16
    return rest


def escape(payload: bytes) -> bytes:
    """Return a payload with FD repeated wherever it ends FF FF FD."""
    out = bytearray()
    for byte in payload:
        out.append(byte)
        if out[-3:] == b"\xff\xff\xfd":
            out.append(0xFD)
    return bytes(out)


def unescape(payload: bytes) -> bytes | None:
    """Return the payload before `escape`; None when FF FF FD stands without its FD."""
    out, doubled = bytearray(), False
    for byte in payload:
        if doubled and byte != 0xFD:
            return None
        if not doubled:
            out.append(byte)
        doubled = not doubled and out[-3:] == b"\xff\xff\xfd"
    return None if doubled else bytes(out)


def status(identity: int, error: int, parameters: bytes = b"", *, escaped: bool = True) -> bytes:
    """Return a status packet. escaped: whether it is stuffed, as it must be."""
    payload = bytes((0x55, error)) + parameters
    return _packet(identity, escape(payload) if escaped else payload)


def instruction(identity: int, code: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, as a host sends it."""
    return _packet(identity, escape(bytes((code,)) + parameters))


def _packet(identity: int, payload: bytes) -> bytes:
    size = len(payload) + 2
    packet = bytes((*PREAMBLE, identity, size & 255, size >> 8)) + payload
    remainder = checksum(packet)
    return packet + bytes((remainder & 255, remainder >> 8))


class RequestParser:
    """Collects bytes into requests."""

    def __init__(self) -> None:
        self._heard = bytearray()

    def hear(self, data: bytes) -> list[Request]:
        """Return the requests that are complete now."""
        self._heard.extend(data)
        requests = []
        while (request := self._next()) is not None:
            requests.append(request)
        return requests

    def _next(self) -> Request | None:
        heard = self._heard
        while len(heard) >= 4 and tuple(heard[:4]) != PREAMBLE:
            heard.pop(0)
        if len(heard) < 10:
            return None
        end = 7 + heard[5] + 256 * heard[6]
        if len(heard) < end:
            return None
        packet = bytes(heard[:end])
        del heard[:end]
        right = checksum(packet[:-2]) == packet[-2] + 256 * packet[-1]
        payload = unescape(packet[7:-2]) if right else None
        if payload is None:
            return Request(packet[4], packet[7], b"", whole=False)
        return Request(packet[4], payload[0], payload[1:])


EVERYONE = 254
PING, READ, WRITE, REBOOT = 0x01, 0x02, 0x03, 0x08
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ, BULK_READ, FAST_BULK_READ = 0x82, 0x83, 0x8A, 0x92, 0x9A
RETURN_DELAY_UNIT = 2_000
"""ns"""
BOOT_TIME = 300_000_000
"""ns without an answer after a reboot."""


class EmulatedBus:
    """A line with motors on it, at `path` (a link to the terminal).

    sent: data of every reply with measurements that was sent whole, as (clock in ns, address, bytes), the
    newest `kept`.
    """

    def __init__(
        self, path: Path, motors: Sequence[EmulatedMotor], misbehaviour: Misbehaviour, kept: int = KEPT
    ) -> None:
        self._path, self._motors, self._wrong = path, motors, misbehaviour
        self._listener = RequestParser()
        self._waiting: list[tuple[int, bytes]] = []
        self._busy_until = [0] * len(motors)
        self._rates = [motor.rate for motor in motors]
        self.sent: deque[tuple[int, int, bytes]] = deque(maxlen=kept)
        self.unknown = 0
        self.descriptor = -1
        self.appear()

    def appear(self, name: str = "") -> None:
        """Plug the adapter in. name: of the file that it gets then, where that is another one."""
        if self.descriptor >= 0:
            return
        self.descriptor, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self.descriptor, False)
        self._link = self._path.with_name(name) if name else self._path
        aside = self._path.with_name(f"{PREFIX}{secrets.token_hex(4)}")
        aside.symlink_to(os.ttyname(self._far))
        aside.replace(self._link)

    def vanish(self) -> None:
        """Pull the adapter out: the port hangs up and its name is gone."""
        if self.descriptor >= 0:
            self._link.unlink(missing_ok=True)
            os.close(self._far)
            os.close(self.descriptor)
            self.descriptor = -1
            self._waiting.clear()

    def serve(self, now: int) -> None:
        """Read the host's packets and answer them."""
        try:
            data = os.read(self.descriptor, 4096)
        except OSError:
            return
        for request in self._listener.hear(data):
            self._answer(now, request)
        self.flush(now)

    def flush(self, now: int) -> None:
        """Send the replies whose time has come."""
        due = [packet for when, packet in self._waiting if when <= now]
        self._waiting = [(when, packet) for when, packet in self._waiting if when > now]
        for packet in due:
            with suppress(OSError):
                os.write(self.descriptor, packet)

    @property
    def next_due(self) -> int | None:
        """When the next reply must go out, ns."""
        return min((when for when, _ in self._waiting), default=None)

    def _answer(self, now: int, request: Request) -> None:
        self.unknown += not request.whole
        if not request.whole:
            return
        groups = {
            SYNC_READ: self._sync_read, FAST_SYNC_READ: self._sync_read, SYNC_WRITE: self._sync_write,
            BULK_READ: self._bulk_read, FAST_BULK_READ: self._bulk_read,
        }  # fmt: skip
        if request.instruction in groups:
            return groups[request.instruction](now, request)
        handlers = {PING: self._ping, READ: self._read, WRITE: self._write, REBOOT: self._reboot}
        for motor in self._awake(now):
            if request.identity in (motor.get("id"), EVERYONE):
                if request.instruction in handlers:
                    handlers[request.instruction](now, motor, request)
                elif request.identity != EVERYONE:
                    self._reply(now, motor, UNKNOWN)

    def _awake(self, now: int) -> list[EmulatedMotor]:
        """Return the motors that hear the host: not booting, and at the bit rate that they had at first."""
        return [
            motor
            for motor, end, rate in zip(self._motors, self._busy_until, self._rates, strict=True)
            if now >= end and rate == motor.rate
        ]

    def _motor_of(self, now: int, identity: int) -> EmulatedMotor | None:
        return next((motor for motor in self._awake(now) if motor.get("id") == identity), None)

    def _ping(self, now: int, motor: EmulatedMotor, request: Request) -> None:
        self._reply(now, motor, 0, bytes(motor.memory[0:2] + motor.memory[6:7]))

    def _read(self, now: int, motor: EmulatedMotor, request: Request) -> None:
        if len(request.parameters) != 4:
            return self._reply(now, motor, LENGTH)
        address, length = _pair(request.parameters)
        error, data = motor.read(now, address, length)
        self._reply(now, motor, error, data, address)

    def _write(self, now: int, motor: EmulatedMotor, request: Request) -> None:
        if len(request.parameters) < 3:
            return self._reply(now, motor, LENGTH)
        address = int.from_bytes(request.parameters[:2], "little")
        error = motor.write(now, address, request.parameters[2:])
        if request.identity != EVERYONE and motor.get("status_level") == 2:
            self._reply(now, motor, error)

    def _reboot(self, now: int, motor: EmulatedMotor, request: Request) -> None:
        self._reply(now, motor, 0)
        self._busy_until[self._motors.index(motor)] = now + BOOT_TIME
        motor.reboot(now)

    def _sync_read(self, now: int, request: Request) -> None:
        address, length = _pair(request.parameters)
        wanted = [(identity, address, length) for identity in request.parameters[4:]]
        self._group(now, wanted, fast=request.instruction == FAST_SYNC_READ)

    def _bulk_read(self, now: int, request: Request) -> None:
        blocks = [request.parameters[at : at + 5] for at in range(0, len(request.parameters) - 4, 5)]
        wanted = [(block[0], *_pair(block[1:])) for block in blocks]
        self._group(now, wanted, fast=request.instruction == FAST_BULK_READ)

    def _group(self, now: int, wanted: Sequence[tuple[int, int, int]], *, fast: bool) -> None:
        """Answer in the order of the request: each with a packet of its own, or all in one.

        A motor that does not answer ends a joint packet: those behind it wait for its part.
        """
        parts = []
        for identity, address, length in wanted:
            motor = self._motor_of(now, identity)
            if motor is None:
                break
            error, data = motor.read(now, address, length)
            if fast:
                parts.append((motor, address, bytes((_error(motor, error), identity)) + data))
            else:
                self._reply(now, motor, error, data, address)
        if fast and len(parts) == len(wanted):
            self._joint(now, parts)

    def _joint(self, now: int, parts: Sequence[tuple[EmulatedMotor, int, bytes]]) -> None:
        """Send the joint reply: error, ID, data and the CRC of all before it, of each motor."""
        size = 1 + sum(len(part) + 2 for _, _, part in parts)
        packet = bytes((0xFF, 0xFF, 0xFD, 0, EVERYONE, size & 255, size >> 8, 0x55))
        for _, _, part in parts:
            packet += part
            remainder = checksum(packet)
            packet += bytes((remainder & 255, remainder >> 8))
        motor, address, part = parts[0]
        self._send(now, motor, packet, address, part[2:])

    def _sync_write(self, now: int, request: Request) -> None:
        address, length = _pair(request.parameters)
        items = request.parameters[4:]
        for at in range(0, len(items) - length, length + 1):
            motor = self._motor_of(now, items[at])
            if motor is not None:
                motor.write(now, address, items[at + 1 : at + 1 + length])

    def _reply(
        self, now: int, motor: EmulatedMotor, error: int, data: bytes = b"", address: int = -1
    ) -> None:
        escaped = not self._wrong.happens("unstuffed")
        packet = status(motor.get("id"), _error(motor, error), data, escaped=escaped)
        self._send(now, motor, packet, address, data)

    def _send(self, now: int, motor: EmulatedMotor, packet: bytes, address: int, data: bytes) -> None:
        packet = self._wrong.damage(packet)
        when = now + motor.get("return_delay") * RETURN_DELAY_UNIT
        if self._wrong.happens("delay"):
            when += round(self._wrong.late * 1e9)
        if packet:
            self._waiting.append((when, packet))
        if packet and address >= 0:
            self.sent.append((now, address, data))


def _error(motor: EmulatedMotor, error: int) -> int:
    return error | (0x80 if motor.alert else 0)


def _pair(parameters: bytes) -> tuple[int, int]:
    """Return address and length at the head of parameters."""
    return int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
