"""A thread that drains the socket: the newest record is at hand, and every record has its own stamp."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections import Counter, deque
from typing import NamedTuple

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.netft.records import STOP, STREAM, Record, Sequence, decode, request

SO_TIMESTAMPNS = 35
"""Linux: the kernel stamps a datagram on arrival, however late the thread comes to fetch it."""
_STAMP = struct.Struct("@qq")
ANCILLARY = socket.CMSG_SPACE(_STAMP.size)
PAUSE = 1e-3
"""s between two drainings; the kernel keeps 7 records meanwhile at 7 kHz, and holds 256."""
ASK_AGAIN = 0.2
"""s of silence after which the stream is asked for again."""
KEPT = 4096


class Arrival(NamedTuple):
    """A record and when it arrived, ns since the epoch."""

    stamp: int
    record: Record


class Receiver:
    """Ask a sensor for its stream and keep what comes.

    sequence: counts of what came and what is gone. refused: datagrams that were no records.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self.sequence = Sequence()
        self.refused: Counter[str] = Counter()
        self._waiting: deque[Arrival] = deque(maxlen=KEPT)
        self.newest: Arrival | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Ask for the stream and begin to receive. Raises DeviceError."""
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            self._socket.connect(self._address)  # from nobody else
            self._socket.settimeout(ASK_AGAIN)
            self._socket.send(request(STREAM))
        except OSError as error:
            raise DeviceError(f"F/T sensor {self._address[0]}:{self._address[1]}: {error}") from None
        self.sequence.forget()
        self.newest = None
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name="netft", daemon=True)
        self._thread.start()

    def send(self, command: int) -> None:
        """Send a command, then ask for the stream again."""
        with contextlib.suppress(OSError):
            self._socket.send(request(command))
            self.sequence.begin()
            self._socket.send(request(STREAM))

    def take(self) -> list[Arrival]:
        """Return the records that have come since the last call, oldest first."""
        taken = []
        while self._waiting:
            taken.append(self._waiting.popleft())
        return taken

    def close(self) -> None:
        """Stop the stream and the thread."""
        self._stop.set()
        if self._thread is not None:
            with contextlib.suppress(OSError):
                self._socket.send(request(STOP))
            self._thread.join()
            self._socket.close()
            self._thread = None

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._keep(*self._socket.recvmsg(SIZE_AND_MORE, ANCILLARY))
                self._drain()
            except TimeoutError:
                self.send(STREAM)
            except OSError:  # the box is switched off: its port is closed until it is back
                self._stop.wait(ASK_AGAIN)
                self.send(STREAM)
            self._stop.wait(PAUSE)

    def _drain(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                self._keep(*self._socket.recvmsg(SIZE_AND_MORE, ANCILLARY, socket.MSG_DONTWAIT))

    def _keep(self, data: bytes, ancillary: list[tuple[int, int, bytes]], flags: int, sender: object) -> None:
        record = decode(data)
        if record is None:
            self.refused["length"] += 1
        elif self.sequence.accept(record):
            self.newest = Arrival(_arrived(ancillary), record)
            self._waiting.append(self.newest)


SIZE_AND_MORE = 64
"""Bytes asked of the socket: more than a record, so that one which is too long is seen to be."""


def _arrived(ancillary: list[tuple[int, int, bytes]]) -> int:
    """Return the kernel's stamp of a datagram, ns; now when it has none."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(data) >= _STAMP.size:
            seconds, nanoseconds = _STAMP.unpack(data[: _STAMP.size])
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return time.time_ns()
