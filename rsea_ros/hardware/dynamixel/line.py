"""Several motors on one bus: one sync write and one sync read a cycle for all of them.

A sync write has no acknowledgement: a goal that is lost is sent again in the next cycle, with all the others,
and that a motor does not make its torque shows in its current. Its own bus watchdog, or its supervisor, ends
the torque of each motor after the driver's death.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Sequence

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply, PortLost
from rsea_ros.hardware.dynamixel.bus import ALERT
from rsea_ros.hardware.dynamixel.frames import frame
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel.port import Port
from rsea_ros.hardware.dynamixel.receiver import BROADCAST, Receiver
from rsea_ros.hardware.dynamixel.sample import Sample, sample_of
from rsea_ros.hardware.dynamixel.settings import Settings
from rsea_ros.hardware.dynamixel.tables import ControlTable

SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x82, 0x83, 0x8A
EMPTY = 11
"""Bytes of a status packet without parameters."""


class Line:
    """Motors of one series on a port; open it, then `exchange` once a cycle.

    settings: of each motor, all with one path, baud rate and latency. fast: whether one joint reply is asked
    for, which newer firmware gives. goals: counts by ID. lost: replies that did not come, by ID.
    """

    def __init__(self, settings: Sequence[Settings], *, fast: bool = False) -> None:
        first = settings[0]
        self.port = Port(first.path, first.baud, first.latency)
        self.motors = {each.identity: Motor(each, self.port) for each in settings}
        if len(self.motors) != len(settings):
            raise DeviceError(f"motors on {first.path}: an ID twice, expected each once")
        self._fast, self._receiver = fast, Receiver()
        self.goals: dict[int, int] = dict.fromkeys(self.motors, 0)
        self.lost: Counter[int] = Counter()
        self.busy = threading.Lock()
        self._longer = 0
        self._samples: dict[int, tuple[int, bytes]] = {}
        self._instant = 0
        self._gone: PortLost | None = None
        self._table: ControlTable | None = None

    def open(self) -> None:
        """Open the port and each motor, torque off. Raises DeviceError; nothing stays open then."""
        self.port.open()
        try:
            for motor in self.motors.values():
                motor.open()
            self._table = next(iter(self.motors.values())).known
            if len({motor.known.series for motor in self.motors.values()}) > 1:
                names = ", ".join(motor.known.name for motor in self.motors.values())
                raise DeviceError(f"motors on {self.port.port_name}: {names}, expected motors of one series")
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """Zero torque of all, off, port closed."""
        for motor in self.motors.values():
            motor.close()
        self.port.close()

    def exchange(self) -> None:
        """Write all goals, then read all motors; `sample` has what came.

        Nothing happens while somebody talks to a single motor: nobody is heard in this cycle then.
        """
        self._samples, self._gone = {}, None
        if not self.busy.acquire(blocking=False):
            return
        try:
            self._write()
            self._samples = self._read()
        except PortLost as error:
            self._gone = error
        finally:
            self.busy.release()

    def write(self) -> None:
        """Write all goals, unless somebody talks to a single motor."""
        if self.busy.acquire(blocking=False):
            try:
                self._write()
            except PortLost as error:
                self._gone = error
            finally:
                self.busy.release()

    def sample(self, identity: int) -> Sample:
        """Return what a motor has sent in the last exchange. Raises NoReply, PortLost."""
        motor = self.motors[identity]
        table = motor.known
        if self._gone is not None:
            raise self._gone
        if identity not in self._samples:
            self.lost[identity] += 1
            raise NoReply(f"motor ID {identity} on {self.port.port_name}: no reply to the sync read")
        error, data = self._samples[identity]
        motor.bus.alert = bool(error & ALERT)
        if not self.busy.acquire(blocking=False):
            return sample_of(table, data, self._instant)
        try:
            return motor.sample(data, self._instant)
        finally:
            self.busy.release()

    @property
    def _known(self) -> ControlTable:
        if self._table is None:
            raise PortLost(f"motors on {self.port.port_name}: not open")
        return self._table

    def _write(self) -> None:
        goal = self._known.goal_torque
        body = bytes((SYNC_WRITE, *_two(goal.address), *_two(goal.size)))
        for identity, counts in self.goals.items():
            body += bytes((identity, *goal.data(counts)))
        self.port.writePort(frame(BROADCAST, body))

    def _read(self) -> dict[int, tuple[int, bytes]]:
        """Return error byte and data of each motor that answered."""
        start, size = self._known.sample
        size += self._longer
        code = FAST_SYNC_READ if self._fast else SYNC_READ
        self.port.clearPort()
        self._receiver.reset()
        begin = time.monotonic_ns()
        self.port.writePort(frame(BROADCAST, bytes((code, *_two(start), *_two(size), *self.motors))))
        self.port.setPacketTimeout((EMPTY + size) * len(self.motors))
        answers = self._answers(size)
        self._instant = (begin + time.monotonic_ns()) // 2
        if len(answers) < len(self.motors):
            self._longer ^= 1  # a reply that comes late has another size than the next one
        return answers

    def _answers(self, size: int) -> dict[int, tuple[int, bytes]]:
        answers: dict[int, tuple[int, bytes]] = {}
        while len(answers) < len(self.motors):
            data = self.port.receive()
            for packet in self._receiver.feed(data, raw=self._fast):
                answers |= _joint(packet, size) if self._fast else _single(packet, size)
            if not data and self.port.isPacketTimeout():
                break
        return {identity: each for identity, each in answers.items() if identity in self.motors}

    def reopen(self) -> None:
        """Open the port anew; each motor has to be set up again. Raises PortLost."""
        for motor in self.motors.values():
            motor.close()
        self.port.close()
        self.port.open()

    @property
    def lost_port(self) -> bool:
        """Whether the port is gone."""
        try:
            self.port.writePort(b"")
            self.port.receive()
        except PortLost:
            return True
        return self.port.descriptor < 0


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
    found = {}
    for at in range(0, len(parts), step):
        found[parts[at + 1]] = (parts[at], parts[at + 2 : at + 2 + size])
    return found
