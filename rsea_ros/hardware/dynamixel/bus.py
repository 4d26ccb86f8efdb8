"""A serial port that waits instead of spinning, and transactions with one motor on it.

Every result and error byte is checked, every failure counted by kind.
"""

from __future__ import annotations

import os
import select
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import dynamixel_sdk as sdk
import serial  # type: ignore[import-untyped]

from rsea_ros.hardware.bus_motor import T, repeat
from rsea_ros.hardware.device import NoReply, PortLost, Refused
from rsea_ros.hardware.dynamixel import frames
from rsea_ros.hardware.dynamixel.control_tables import Item

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


class SerialPort(sdk.PortHandler):  # type: ignore[misc]  # the SDK has no types
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


PATIENCE = 0.02
"""s by which a reply may be late outside the cycle."""
ALERT = 0x80
REFUSALS = {
    1: "failed", 2: "unknown instruction", 3: "CRC wrong", 5: "length wrong", 6: "value beyond its limit",
    4: "value out of range, or its bus watchdog has ended the torque", 7: "access denied",
}  # fmt: skip
EMPTY = 11
"""Bytes of a status packet without parameters."""


class PacketHandler(sdk.Protocol2PacketHandler):  # type: ignore[misc]  # the SDK has no types
    """Protocol 2.0 of the SDK with its wrong parts replaced; `receiver.rejected` counts damaged frames.

    txPacket of dynamixel-sdk 4.1.0 sends FF FF FD unstuffed, removeStuffing loses bytes, and rxPacket spins.

    expected: parameters of the reply that is waited for; one of another size answers an older request, is
    left out and counted (`stale`, `acknowledged` where it has neither parameters nor an error). None: any. A
    refusal has no parameters and is accepted.
    meanwhile: done once while the next reply is on its way.
    """

    def __init__(self) -> None:
        self.receiver = frames.StatusFrameParser()
        self.stale = self.acknowledged = 0
        self.expected: int | None = None
        self.meanwhile: Callable[[], None] | None = None
        self._frames: list[bytes] = []

    def updateCRC(self, crc_accum: int, data_blk_ptr: Sequence[int], data_blk_size: int) -> int:
        """Return the CRC of the first bytes of a block."""
        return frames.crc16(data_blk_ptr[:data_blk_size], crc_accum)

    def addStuffing(self, packet: Sequence[int]) -> list[int]:
        """Return a packet with INST and parameters stuffed and LEN put right; the CRC is not."""
        return _with_payload(packet, frames.stuff(_payload(packet)))

    def removeStuffing(self, packet: Sequence[int]) -> list[int]:
        """Return a packet with INST and parameters as they were before stuffing.

        Raises ValueError for one that no stuffing makes.
        """
        plain = frames.unstuff(_payload(packet))
        if plain is None:
            raise ValueError(f"packet {bytes(packet).hex(' ')}: FF FF FD inside, expected FF FF FD FD")
        return _with_payload(packet, plain)

    def txPacket(self, port: SerialPort, txpacket: Sequence[int]) -> int:
        """Stuff, sign and send a packet; earlier input is discarded. Raises PortLost."""
        data = frames.frame(txpacket[4], _payload(txpacket))
        if len(data) > frames.LONGEST:
            return int(sdk.COMM_TX_ERROR)
        port.clearPort()
        self.receiver.reset()
        self._frames.clear()
        sent = port.writePort(data)
        return int(sdk.COMM_SUCCESS if sent == len(data) else sdk.COMM_TX_FAIL)

    def rxPacket(self, port: SerialPort, fast_option: bool) -> tuple[bytes, int]:
        """Wait for the next status packet until the port's time is over. Raises PortLost."""
        rejected = self.receiver.rejected.total()
        meanwhile, self.meanwhile = self.meanwhile, None
        if meanwhile is not None:
            meanwhile()
        while True:
            while self._frames:
                packet = self._frames.pop(0)
                if self._answers(packet):
                    return packet, int(sdk.COMM_SUCCESS)
                self.stale += 1
                self.acknowledged += len(packet) == EMPTY and not packet[8] & 0x7F
            data = port.receive()
            self._frames += self.receiver.feed(data, raw=fast_option)
            if not data and port.isPacketTimeout():
                damaged = self.receiver.waiting or self.receiver.rejected.total() > rejected
                return b"", int(sdk.COMM_RX_CORRUPT if damaged else sdk.COMM_RX_TIMEOUT)

    def _answers(self, packet: bytes) -> bool:
        parameters, refused = len(packet) - EMPTY, packet[8] & 0x7F
        return self.expected is None or parameters == self.expected or bool(refused and not parameters)


def _payload(packet: Sequence[int]) -> bytes:
    """Return INST and parameters of a packet by its LEN."""
    return bytes(packet[frames.OVERHEAD : frames.OVERHEAD - 2 + packet[5] + (packet[6] << 8)])


def _with_payload(packet: Sequence[int], payload: bytes) -> list[int]:
    length = len(payload) + 2
    return [*packet[:5], length & 0xFF, length >> 8, *payload, *packet[-2:]]


class Bus:
    """One motor, or another device, on a port.

    alert: bit 7 of the last error byte. errors: failed transactions by kind.
    latency, return_delay: see SerialPort; of this motor's transactions, also where others use the port.
    """

    def __init__(self, port: SerialPort, identity: int, kind: str = "motor") -> None:
        self.port, self._id, self._name = port, identity, f"{kind} ID {identity}"
        self.latency, self.return_delay = port.latency, port.return_delay
        self.handler = PacketHandler()
        self._failed: Counter[str] = Counter()
        self.alert = False

    @property
    def errors(self) -> Counter[str]:
        """Failed transactions (`lost`, `corrupt`, `refused`), `stale` replies, damaged frames (`crc`, …)."""
        return self._failed + self.handler.receiver.rejected + Counter(stale=self.handler.stale)

    def ping(self) -> int:
        """Return the model number. Raises NoReply."""
        self.handler.expected = 3
        with self._turn():
            model, result, error = self.handler.ping(self.port, self._id)
        self._check("ping", result, error)
        return int(model)

    def read(self, address: int, size: int, meanwhile: Callable[[], None] | None = None) -> bytes:
        """Return bytes of the control table. Raises NoReply, Refused, PortLost.

        meanwhile: done while the reply is on its way.
        """
        self.handler.expected, self.handler.meanwhile = size, meanwhile
        with self._turn():
            data, result, error = self.handler.readTxRx(self.port, self._id, address, size)
        self._check(f"read of {size} bytes at {address}", result, error)
        return bytes(data)

    def get(self, item: Item) -> int:
        """Return an item."""
        return item.value(self.read(item.address, item.size), item.address)

    def put(self, item: Item, value: int) -> None:
        """Write an item; the motor has acknowledged it when this returns."""
        self.handler.expected = 0
        data = item.data(value)
        with self._turn():
            result, error = self.handler.writeTxRx(self.port, self._id, item.address, item.size, data)
        self._check(f"write of {value} at {item.address}", result, error)

    def patiently(self, transaction: Callable[[], T]) -> T:
        """Return the result of a transaction outside the cycle, with several attempts."""
        usual, self.latency = self.latency, max(self.latency, PATIENCE)
        try:
            return repeat(transaction)
        finally:
            self.latency = usual

    def set(self, item: Item, value: int) -> None:
        """Write an item outside the cycle, patiently."""
        self.patiently(lambda: self.put(item, value))

    def reboot(self) -> None:
        """Reboot the motor."""
        self.handler.expected = 0
        with self._turn():
            result, error = self.handler.reboot(self.port, self._id)
        self._check("reboot", result, error)

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Have the port for a transaction."""
        with self.port.turns.take():
            self.port.latency, self.port.return_delay = self.latency, self.return_delay
            yield

    def _check(self, request: str, result: int, error: int) -> None:
        if result != sdk.COMM_SUCCESS:
            kind = "corrupt" if result == sdk.COMM_RX_CORRUPT else "lost"
            self._failed[kind] += 1
            reply = "a damaged reply" if kind == "corrupt" else "no reply"
            raise NoReply(f"{self._name} on {self.port.port_name}: {reply} to {request}")
        self.alert = bool(error & ALERT)
        if error & ~ALERT:
            self._failed["refused"] += 1
            why = REFUSALS.get(error & ~ALERT, f"error {error & ~ALERT}")
            raise Refused(f"{self._name}: {request} refused: {why}")
