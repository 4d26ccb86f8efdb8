"""The motor's end of the serial line: a pseudo-terminal that answers every instruction of Protocol 2.0."""

from __future__ import annotations

import os
import secrets
import tty
from collections import deque
from contextlib import suppress
from pathlib import Path

from rsea_ros.files import PREFIX
from rsea_ros.hardware.peer.misbehaviour import Misbehaviour
from rsea_ros.hardware.peer.motor import KEPT, LENGTH, UNKNOWN, Motor
from rsea_ros.hardware.peer.protocol2 import Listener, Request, checksum, status

EVERYONE = 254
PING, READ, WRITE, REBOOT = 0x01, 0x02, 0x03, 0x08
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ, BULK_READ, FAST_BULK_READ = 0x82, 0x83, 0x8A, 0x92, 0x9A
RETURN_DELAY_UNIT = 2_000
"""ns"""
BOOT_TIME = 300_000_000
"""ns without an answer after a reboot."""


class Bus:
    """A line with one motor on it, at `path` (a link to the terminal).

    sent: data of every reply with measurements that went out whole, as (clock in ns, address, bytes).
    """

    def __init__(self, path: Path, motor: Motor, misbehaviour: Misbehaviour) -> None:
        self._path, self._motor, self._wrong = path, motor, misbehaviour
        self._listener = Listener()
        self._waiting: list[tuple[int, bytes]] = []
        self._busy_until = 0
        self.sent: deque[tuple[int, int, bytes]] = deque(maxlen=KEPT)
        self.unknown = 0
        self.descriptor = -1
        self.appear()

    def appear(self) -> None:
        """Plug the adapter in."""
        if self.descriptor >= 0:
            return
        self.descriptor, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self.descriptor, False)
        aside = self._path.with_name(f"{PREFIX}{secrets.token_hex(4)}")
        aside.symlink_to(os.ttyname(self._far))
        aside.replace(self._path)

    def vanish(self) -> None:
        """Pull the adapter out: the port hangs up and its name is gone."""
        if self.descriptor >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._far)
            os.close(self.descriptor)
            self.descriptor = -1
            self._waiting.clear()

    def serve(self, now: int) -> None:
        """Take what the host has sent and answer it."""
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
        if not request.whole or now < self._busy_until:
            return
        own = self._motor.get("id")
        if request.identity not in (own, EVERYONE):
            return
        single = request.identity == own
        handlers = {PING: self._ping, READ: self._read, WRITE: self._write, REBOOT: self._reboot}
        groups = {
            SYNC_READ: self._sync_read, FAST_SYNC_READ: self._sync_read, SYNC_WRITE: self._sync_write,
            BULK_READ: self._bulk_read, FAST_BULK_READ: self._bulk_read,
        }  # fmt: skip
        if request.instruction in groups:
            groups[request.instruction](now, request)
        elif request.instruction in handlers:
            handlers[request.instruction](now, request)
        elif single:
            self._reply(now, UNKNOWN)

    def _ping(self, now: int, request: Request) -> None:
        self._reply(now, 0, bytes(self._motor.memory[0:2] + self._motor.memory[6:7]))

    def _read(self, now: int, request: Request) -> None:
        if len(request.parameters) != 4:
            return self._reply(now, LENGTH)
        address, length = _pair(request.parameters)
        error, data = self._motor.read(now, address, length)
        self._reply(now, error, data, address)

    def _write(self, now: int, request: Request) -> None:
        if len(request.parameters) < 3:
            return self._reply(now, LENGTH)
        address = int.from_bytes(request.parameters[:2], "little")
        error = self._motor.write(now, address, request.parameters[2:])
        if request.identity != EVERYONE and self._motor.get("status_level") == 2:
            self._reply(now, error)

    def _reboot(self, now: int, request: Request) -> None:
        self._reply(now, 0)
        self._busy_until = now + BOOT_TIME
        self._motor.reboot(now)

    def _sync_read(self, now: int, request: Request) -> None:
        address, length = _pair(request.parameters)
        if self._motor.get("id") in request.parameters[4:]:
            self._group(now, request, address, length, fast=request.instruction == FAST_SYNC_READ)

    def _bulk_read(self, now: int, request: Request) -> None:
        for at in range(0, len(request.parameters) - 4, 5):
            if request.parameters[at] == self._motor.get("id"):
                address, length = _pair(request.parameters[at + 1 : at + 5])
                self._group(now, request, address, length, fast=request.instruction == FAST_BULK_READ)

    def _group(self, now: int, request: Request, address: int, length: int, *, fast: bool) -> None:
        error, data = self._motor.read(now, address, length)
        if not fast:
            return self._reply(now, error, data, address)
        size = len(data) + 5
        packet = bytes((0xFF, 0xFF, 0xFD, 0, EVERYONE, size & 255, size >> 8, 0x55))
        packet += bytes((self._error(error), self._motor.get("id"))) + data
        remainder = checksum(packet)
        self._send(now, packet + bytes((remainder & 255, remainder >> 8)), address, data)

    def _sync_write(self, now: int, request: Request) -> None:
        address, length = _pair(request.parameters)
        items = request.parameters[4:]
        for at in range(0, len(items) - length, length + 1):
            if items[at] == self._motor.get("id"):
                self._motor.write(now, address, items[at + 1 : at + 1 + length])

    def _error(self, error: int) -> int:
        return error | (0x80 if self._motor.alert else 0)

    def _reply(self, now: int, error: int, data: bytes = b"", address: int = -1) -> None:
        own = self._motor.get("id")
        escaped = not self._wrong.happens("unstuffed")
        self._send(now, status(own, self._error(error), data, escaped=escaped), address, data)

    def _send(self, now: int, packet: bytes, address: int, data: bytes) -> None:
        packet = self._wrong.damaged(packet)
        when = now + self._motor.get("return_delay") * RETURN_DELAY_UNIT
        if self._wrong.happens("delay"):
            when += round(self._wrong.late * 1e9)
        if packet:
            self._waiting.append((when, packet))
        if packet and address >= 0:
            self.sent.append((now, address, data))


def _pair(parameters: bytes) -> tuple[int, int]:
    """Return address and length at the head of parameters."""
    return int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
