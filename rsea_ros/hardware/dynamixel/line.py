"""Several motors on one line, read and written in one exchange.

A sync write has no acknowledgement: a goal that is lost is sent again in the next cycle, with all the others,
and that a motor does not make its torque shows in its current. Its own bus watchdog, or its supervisor, ends
the torque of each motor after the driver's death.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply, PortLost, State
from rsea_ros.hardware.dynamixel.bus import ALERT, SerialPort
from rsea_ros.hardware.dynamixel.control_tables import ControlTable, MotorConnection
from rsea_ros.hardware.dynamixel.frames import BROADCAST, StatusFrameParser, frame
from rsea_ros.hardware.dynamixel.motor import Motor

SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x82, 0x83, 0x8A
EMPTY = 11
"""Bytes of a status packet without parameters."""


class StatusReply(NamedTuple):
    """Error byte, data of the table's sample, middle of the transaction (monotonic ns)."""

    error: int
    data: bytes
    instant: int


class Line:
    """A port with motors of one series. Each joins when it is opened, and gives its goal before `exchange`.

    fast: whether to request one joint reply, which newer firmware supports. Motors behind a silent one wait
    for its reply: it is last in the next request, in which each motor replies separately.
    """

    def __init__(self, path: str, baud: int, latency: float, *, fast: bool = False) -> None:
        self.port = SerialPort(path, baud, latency)
        self._latency, self._fast, self._receiver = latency, fast, StatusFrameParser()
        self._joined: dict[int, Callable[[], None]] = {}
        self._delays: dict[int, float] = {}
        self._table: ControlTable | None = None
        self._goals: dict[int, int] = {}
        self._answers: dict[int, StatusReply | PortLost | None] = {}
        self._silent, self._last = False, list[int]()
        self._longer = 0

    def join(self, identity: int, close: Callable[[], None]) -> None:
        """Open the port for a motor, unless it is open. close: closes that motor. Raises PortLost."""
        with self.port.turns.take():
            if not self._joined:
                self.port.open()
            self._joined[identity] = close

    def admit(self, identity: int, table: ControlTable, return_delay: float) -> None:
        """Take a motor that has been set up into the exchange. Raises DeviceError for another series."""
        if self._table is not None and self._table.series != table.series:
            names = f"{self._table.name}, {table.name}"
            raise DeviceError(f"motors on {self.port.port_name}: {names}, expected motors of one series")
        self._table, self._delays[identity] = table, return_delay

    def leave(self, identity: int) -> None:
        """Close the port with the last motor that leaves."""
        with self.port.turns.take():
            self._goals.pop(identity, None)
            if self._joined.pop(identity, None) is not None and not self._joined:
                self.port.close()
                self._table = None

    def set_goal(self, identity: int, counts: int) -> None:
        """Set the goal that the next exchange writes; the motor is read in that exchange."""
        self._goals[identity] = counts

    def exchange(self) -> None:
        """Write the goals that were set, then read these motors; `answer` returns the replies."""
        goals, self._goals = self._goals, {}
        if goals:
            with self.port.turns.take():
                try:
                    self._write(goals)
                    self._answers |= self._read(sorted(goals, key=self._place))
                except PortLost as error:
                    self._answers |= dict.fromkeys(goals, error)

    def send(self) -> None:
        """Write the goals that were set and read nobody; a port that is lost shows in the next exchange."""
        goals, self._goals = self._goals, {}
        if goals:
            with self.port.turns.take():
                try:
                    self._write(goals)
                except PortLost:
                    return

    def has_read(self, identity: int) -> bool:
        """Whether the last exchange has read a motor and its answer has not been taken yet."""
        return identity in self._answers

    def answer(self, identity: int) -> StatusReply:
        """Return the reply of a motor in the last exchange, once. Raises NoReply, PortLost."""
        answer = self._answers.pop(identity)
        if answer is None:
            raise NoReply(f"motor ID {identity} on {self.port.port_name}: no reply to the sync read")
        if isinstance(answer, PortLost):
            raise answer
        return answer

    def give_up(self) -> None:
        """Close all motors and a lost port; each motor must be opened again."""
        for close in list(self._joined.values()):
            close()

    def _write(self, goals: dict[int, int]) -> None:
        goal = self._known_table.goal_torque
        body = bytes((SYNC_WRITE, *_two(goal.address), *_two(goal.size)))
        for identity, counts in goals.items():
            body += bytes((identity, *goal.data(counts)))
        self.port.writePort(frame(BROADCAST, body))

    def _read(self, order: list[int]) -> dict[int, StatusReply | PortLost | None]:
        """Return the answer of each motor, None of one that has none."""
        start, size = self._known_table.sample
        size += self._longer
        fast = self._fast and not self._silent
        code = FAST_SYNC_READ if fast else SYNC_READ
        self.port.clearPort()
        self._receiver.reset()
        begin = time.monotonic_ns()
        self.port.writePort(frame(BROADCAST, bytes((code, *_two(start), *_two(size), *order))))
        self.port.latency = self._latency
        self.port.return_delay = sum(self._delays.get(identity, 0.0) for identity in order)
        self.port.setPacketTimeout((EMPTY + size) * len(order))
        heard = self._receive(order, size, fast=fast)
        instant = (begin + time.monotonic_ns()) // 2
        silent = [identity for identity in order if identity not in heard]
        self._silent = bool(silent)
        if silent:
            self._last = [each for each in self._last if each != silent[0]] + silent[:1]
            self._longer ^= 1  # a reply that comes late has another size than the next one
        return {each: StatusReply(*heard[each], instant) if each in heard else None for each in order}

    def _receive(self, order: list[int], size: int, *, fast: bool) -> dict[int, tuple[int, bytes]]:
        heard: dict[int, tuple[int, bytes]] = {}
        while not heard.keys() >= set(order):
            data = self.port.receive()
            for packet in self._receiver.feed(data, raw=fast):
                heard |= _joint(packet, size) if fast else _single(packet, size)
            if not data and self.port.isPacketTimeout():
                break
        return {identity: each for identity, each in heard.items() if identity in order}

    def _place(self, identity: int) -> int:
        """Return the place in a request: the last that was silent is the last."""
        return self._last.index(identity) if identity in self._last else -1

    @property
    def _known_table(self) -> ControlTable:
        if self._table is None:
            raise PortLost(f"motors on {self.port.port_name}: not open")
        return self._table


def _two(value: int) -> bytes:
    return value.to_bytes(2, "little")


def _single(packet: bytes, size: int) -> dict[int, tuple[int, bytes]]:
    """Return a reply of one motor by its ID; nothing of one that has another size."""
    return {packet[4]: (packet[8], packet[9:-2])} if len(packet) == EMPTY + size else {}


def _joint(packet: bytes, size: int) -> dict[int, tuple[int, bytes]]:
    """Return the parts of the joint reply to a fast read: error, ID, data, CRC of each, by ID."""
    parts, step = packet[8:], size + 4
    if packet[4] != BROADCAST or len(parts) % step:
        return {}
    replies = {}
    for at in range(0, len(parts), step):
        replies[parts[at + 1]] = (parts[at], parts[at + 2 : at + 2 + size])
    return replies


class LineMotor(Motor):
    """As Motor. The exchange comes between `write` and `read`; without one `read` asks the motor alone."""

    def __init__(self, settings: MotorConnection, line: Line) -> None:
        super().__init__(settings, line.port)
        self._line, self._id = line, settings.identity

    def _set_up(self) -> None:
        """Join the line and be set up, torque off. Raises DeviceError, also for a motor of another series."""
        self._line.join(self._id, self._let_go)
        super()._set_up()
        self._line.admit(self._id, self.control_table, self.bus.return_delay)

    def read(self, meanwhile: Callable[[], None] | None = None) -> State:
        """Return the reading of the exchange, or a separate one. Raises NoReply, PortLost, Refused."""
        if not self._line.has_read(self._id):
            return super().read(meanwhile)
        if meanwhile is not None:
            meanwhile()
        answer = self._line.answer(self._id)
        self.bus.alert = bool(answer.error & ALERT)
        return self.sample(answer.data, answer.instant)

    def write(self, torque: float) -> None:
        """Set the goal (N m) that the next exchange writes. Raises PortLost."""
        self._line.set_goal(self._id, self.counts(torque))

    def recover(self) -> None:
        """Reconnect; where the port was lost, every motor of the line must be recovered.

        Nothing is closed of a motor that is away: its supervisor, let go, would stop it on the port of all.
        """
        try:
            self.bus.patiently(self.bus.ping)
        except PortLost:
            self._line.give_up()
        except NoReply:
            raise
        except DeviceError:
            pass  # a fault of this motor alone is handled below
        super().recover()

    def _let_go(self) -> None:
        """Zero torque, off; the last motor of the line closes the port."""
        super()._let_go()
        self._line.leave(self._id)
