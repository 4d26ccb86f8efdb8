"""The serial port: it waits instead of spinning, and a reply is late after the time that the wire needs."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import serial  # type: ignore[import-untyped]
from dynamixel_sdk import PortHandler

from rsea_ros.hardware.device import PortLost

BAUD_RATES = (
    9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 6_000_000, 10_500_000,
)  # fmt: skip
"""What the motors can do, bit/s."""
BITS_PER_BYTE = 10
RETURN_DELAY = 500e-6
"""s, of a motor as it is delivered."""


class Turns:
    """Turns on a port, one transaction each: a waiting thread comes before one that has just finished."""

    def __init__(self) -> None:
        self._next, self._used = threading.Lock(), threading.Lock()

    @contextmanager
    def take(self) -> Iterator[None]:
        """Wait for the port, and let nobody else have it meanwhile."""
        with self._next:
            self._used.acquire()
        try:
            yield
        finally:
            self._used.release()


class SerialPort(PortHandler):  # type: ignore[misc]  # the SDK has no types
    """PortHandler of the SDK with a blocking wait and a time-out from baud rate, size and return delay.

    latency: allowance for USB adapter and scheduler beside the time on the wire, s.
    return_delay: pause of the motor before it answers, s. Both are those of the transaction under way.
    turns: of the transactions of several motors.
    """

    def __init__(self, path: str, baud: int, latency: float) -> None:
        super().__init__(path)
        self.baudrate = baud
        self.latency, self.return_delay = latency, RETURN_DELAY
        self.turns = Turns()
        self._deadline = 0.0
        self._arrivals: select.epoll | None = None
        self.descriptor = -1

    def open(self) -> None:
        """Open the port for this process alone. Raises PortLost."""
        try:
            self.ser = serial.Serial(self.port_name, self.baudrate, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise PortLost(f"port {self.port_name}: {error}, expected a serial port that is free") from None
        self.is_open, self.is_using = True, False
        self.descriptor = self.ser.fileno()
        self.ser.reset_input_buffer()
        self._arrivals = select.epoll()
        self._arrivals.register(self.descriptor, select.EPOLLIN | select.EPOLLET)

    def close(self) -> None:
        """Let the port go."""
        self.is_open, self.descriptor = False, -1
        if self._arrivals is not None:
            self._arrivals.close()
        if self.ser is not None:
            self.ser.close()

    def writePort(self, packet: bytes) -> int:
        """Send bytes; return how many went out. Raises PortLost."""
        try:
            return os.write(self.descriptor, packet)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise PortLost(f"port {self.port_name}: {error.strerror} while sending") from None

    def clearPort(self) -> None:
        """Discard received bytes."""
        while self._has_arrived(0.0):
            self._take()

    def setPacketTimeout(self, packet_length: int) -> None:
        """Begin to wait for a reply of a number of bytes, after a request of at most 16."""
        on_wire = (packet_length + 16) * BITS_PER_BYTE / self.baudrate
        self.setPacketTimeoutMillis(1e3 * (on_wire + self.return_delay + self.latency))

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Begin to wait."""
        self._deadline = time.monotonic() + 1e-3 * msec

    @property
    def time_left(self) -> float:
        """The remaining wait, s."""
        return max(0.0, self._deadline - time.monotonic())

    def isPacketTimeout(self) -> bool:
        """Return whether the wait is over."""
        return time.monotonic() > self._deadline

    def receive(self) -> bytes:
        """Return the bytes received before the deadline, empty after it. Raises PortLost."""
        return self._take() if self._has_arrived(self.time_left) else b""

    def _has_arrived(self, wait: float) -> bool:
        """Return whether bytes have arrived since the last call, within a time (s).

        Edges, not levels: polling an empty terminal, as select and read do, means waiting for the kernel's
        thread that fills it, whatever the time-out, on a busy machine for a cycle.
        """
        if self._arrivals is None:
            return False
        try:
            select.select((self._arrivals,), (), (), wait)  # epoll itself counts in ms
            return bool(self._arrivals.poll(0.0))
        except (OSError, ValueError) as error:
            raise PortLost(f"port {self.port_name}: {error} while waiting for a reply") from None

    def _take(self) -> bytes:
        try:
            data = os.read(self.descriptor, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortLost(f"port {self.port_name}: {error.strerror} while receiving") from None
        if not data:
            return b""
        return data
