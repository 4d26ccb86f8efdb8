"""A CAN bus by python-can: frames sent, frames waited for, and what its errors mean."""

import errno
import select
import struct
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import NoReply, PortLost
from rsea_ros.hardware.mit_can.frames import Frame

BUS_OFF = 0x40
"""Bit of the identifier of an error frame: the controller has switched itself off."""
OPTIONS: Mapping[str, Mapping[str, float]] = {"slcan": {"sleep_after_open": 0.05, "timeout": 0.0}}
"""By interface. slcan: python-can waits 2 s for a board to boot, and 1 ms for a byte that is not there."""


def _can() -> Any:
    """Return python-can, which no other device needs. Raises ParameterError where it is not installed."""
    try:
        import can
    except ImportError:
        raise ParameterError(
            "parameter device = mit_can: python-can is not installed, expected pip install 'rsea_ros[can]'"
        ) from None
    return can


def _socketcan(start: Frame, size: int) -> bytes:
    """Return the head of the kernel's can_frame and the bytes that are given; a whole frame has 16."""
    return struct.pack("=IB3x", start.identity | start.extended << 31, size) + start.data


def _slcan(start: Frame, size: int) -> bytes:
    kind, width = ("T", 8) if start.extended else ("t", 3)
    return f"{kind}{start.identity:0{width}X}{size}{start.data.hex().upper()}".encode()


WIRES: Mapping[str, tuple[Callable[[Frame, int], bytes], bytes]] = {
    "socketcan": (_socketcan, b""), "slcan": (_slcan, b"\r"),
}  # fmt: skip
"""Interfaces with a descriptor that takes frames as bytes: how one begins, and ends."""


class CanPort:
    """One bus. interface, channel: of python-can. errors: by kind."""

    def __init__(self, interface: str, channel: str, baud: int) -> None:
        self.interface, self.channel, self._baud = interface, channel, baud
        self._bus: Any = None
        self._poll: int | None = None
        self.errors: Counter[str] = Counter()

    @property
    def descriptor(self) -> int | None:
        """Of the bus, where a supervisor could write frames to it."""
        return self._poll if self.interface in WIRES else None

    def wire(self, start: Frame, size: int = 8, *, whole: bool = True) -> bytes:
        """Return a frame as the descriptor takes it, or how one of a size begins there."""
        begin, end = WIRES[self.interface]
        return begin(start, size) + end if whole else begin(start, size)

    def open(self) -> None:
        """Connect. Raises PortLost, ParameterError."""
        can = _can()
        self.close()
        options = OPTIONS.get(self.interface, {})
        try:
            self._bus = can.Bus(
                channel=self.channel, interface=self.interface, bitrate=self._baud, **options
            )
        except (can.CanError, OSError, ValueError, ImportError) as error:
            raise PortLost(f"{self.interface} {self.channel}: {error}") from error
        try:
            self._poll = int(self._bus.fileno())
        except NotImplementedError:
            self._poll = None

    def close(self) -> None:
        """Let it go, also a bus that has vanished."""
        bus, self._bus, self._poll = self._bus, None, None
        if bus is not None:
            try:
                bus.shutdown()
            except (_can().CanError, OSError):
                bus.serialPortOrig.close() if hasattr(bus, "serialPortOrig") else None

    def send(self, frame: Frame) -> None:
        """Send. Raises PortLost; NoReply where nobody on the bus acknowledges, so that no more go out."""
        can = _can()
        message = can.Message(
            arbitration_id=frame.identity, data=frame.data, is_extended_id=frame.extended, check=False
        )
        try:
            self._open_bus().send(message)
        except (can.CanError, OSError) as error:
            if getattr(error, "error_code", None) == errno.ENOBUFS or "buffer full" in str(error):
                self.errors["full"] += 1
                raise NoReply(f"{self.interface} {self.channel}: {error}: nobody acknowledges") from error
            raise PortLost(f"{self.interface} {self.channel}: {error}") from error

    def receive(self, wait: float) -> Frame | None:
        """Return the next frame within some s, None without. Raises PortLost, also for a bus that is off."""
        can, bus = _can(), self._open_bus()
        try:
            if self._poll is not None and wait > 0.0:
                select.select((self._poll,), (), (), wait)
                wait = 0.0
            message = bus.recv(wait)
        except (can.CanError, OSError, ValueError) as error:
            raise PortLost(f"{self.interface} {self.channel}: {error}") from error
        if message is None or message.is_remote_frame:
            return None
        if message.is_error_frame:
            self.errors["error_frames"] += 1
            if message.arbitration_id & BUS_OFF:
                raise PortLost(f"{self.interface} {self.channel}: the controller is bus-off")
            return None
        return Frame(message.arbitration_id, bytes(message.data), bool(message.is_extended_id))

    def _open_bus(self) -> Any:
        if self._bus is None:
            raise PortLost(f"{self.interface} {self.channel}: not open")
        return self._bus
