"""A Dynamixel Pro in torque mode: one read and one write a cycle, in SI units."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply, PortLost
from rsea_ros.hardware.dynamixel.bus import Bus
from rsea_ros.hardware.dynamixel.frames import frame
from rsea_ros.hardware.dynamixel.port import Port
from rsea_ros.hardware.dynamixel.tables import TABLES, ControlTable, Item, error_names
from rsea_ros.hardware.supervised import Supervisor

T = TypeVar("T")
SHARE, REST = 0.4, 1e-4
"""What a reply may be late: part of a cycle, less so many s, half of what the rest of a cycle takes."""
ATTEMPTS, PATIENCE = 5, 0.02
"""Of a transaction outside the cycle: how often it is tried, and how late a reply may be each time, s."""
TORQUE_MODE, ACKNOWLEDGE_ALL = 0, 2
RETURN_DELAY_UNIT = 2e-6
WATCHDOG_UNIT = 0.02
WRITE = 0x03
BOOT_TIME, BOOT_POLL = 5.0, 0.02
LOOK = 0.8
"""s in which each register is looked at once; a fault is latched within a second."""


@dataclass(frozen=True)
class Settings:
    """Where the motor is and what it is.

    baud: bit/s. model: number that is expected, 0 for any known. torque_constant: N m at the gear output
    per A. latency: what adapter and scheduler may add to the time on the wire, s; a reading gets in addition
    what the write before it has left of it. watchdog: s without the host after which the motor's own
    watchdog, or the supervisor, takes the torque away. supervisor: socket of one that runs as a service;
    empty: a child of this process.
    """

    path: str
    baud: int = 1_000_000
    identity: int = 1
    model: int = 0
    torque_constant: float = 6.826
    latency: float = 1e-3
    watchdog: float = 0.1
    supervisor: str = ""


def usual_latency(rate: float) -> float:
    """Return the latency (s) with which a cycle that loses both replies still ends in time. rate: Hz."""
    return max(SHARE / rate - REST, REST)


@dataclass(frozen=True)
class Sample:
    """What one read holds. instant: middle of the transaction, monotonic ns. counts: of the encoder.

    trouble: what the motor's registers are and should not be, in words.
    """

    instant: int
    counts: int
    position: float
    velocity: float
    current: float
    voltage: float
    temperature: float
    hardware_error: str
    trouble: str = ""


class Motor:
    """One motor on a port of its own."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._port = Port(settings.path, settings.baud, settings.latency)
        self.bus = Bus(self._port, settings.identity)
        self._supervisor: Supervisor | None = None
        self._longer, self._spared = 0, 0.0
        self._expected: tuple[tuple[str, Item, int], ...] = ()
        self._looks, self._looked = 0, 0.0
        self.table: ControlTable | None = None
        self.torque_limit = math.nan

    @property
    def _known(self) -> ControlTable:
        if self.table is None:
            raise PortLost(f"motor on {self._settings.path}: not open")
        return self.table

    def open(self) -> None:
        """Open the port, check who answers, switch the torque off, set torque mode, read the limit."""
        self._port.open()
        self.table = table = _table(self.patiently(self.bus.ping), self._settings)
        self._put(table.status_level, ACKNOWLEDGE_ALL)
        self._stop()
        self._port.return_delay = RETURN_DELAY_UNIT * self.patiently(lambda: self.bus.get(table.return_delay))
        if self.patiently(lambda: self.bus.get(table.operating_mode)) != TORQUE_MODE:
            self._put(table.operating_mode, TORQUE_MODE)
        limit = self.patiently(lambda: self.bus.get(table.torque_limit))
        self.torque_limit = limit * table.ampere * self._settings.torque_constant
        self._supervise()

    def enable(self) -> None:
        """Switch the torque on, at zero, with a watchdog. Raises DeviceError."""
        table = self._known
        self._stop()
        armed = max(1, round(self._settings.watchdog / WATCHDOG_UNIT))
        if table.bus_watchdog is not None:
            self._put(table.bus_watchdog, armed)
        self._put(table.torque_enable, 1)
        self._expect(1, armed)

    def disable(self) -> None:
        """Command zero torque and switch it off."""
        if self.table is not None:
            self._stop()
            if self._supervisor is not None:
                self._supervisor.beat(False)

    def read(self, meanwhile: Callable[[], None] | None = None) -> Sample:
        """Read everything that is measured, once. Raises NoReply, PortLost, Refused.

        meanwhile: done while the reply is on its way.

        After a failure the next read is longer or shorter by a byte: a reply that comes late has the wrong
        size and cannot be taken for the new one.
        """
        if self._supervisor is not None:
            self._supervisor.beat()  # to wait for a reply that is lost is not to hang
        table = self._known
        start, size = table.sample
        begin, usual = time.monotonic_ns(), self._port.latency
        self._port.latency = usual + self._spared
        try:
            data = self.bus.read(start, size + self._longer, meanwhile)
        except NoReply:
            self._longer ^= 1
            raise
        finally:
            self._port.latency, self._spared = usual, 0.0
        instant = (begin + time.monotonic_ns()) // 2
        error = error_names(self.bus.get(table.hardware_error)) if self.bus.alert else ""
        trouble = "" if error else self._look_after()
        counts = table.position.value(data, start)
        return Sample(
            instant=instant,
            counts=counts,
            position=counts * 2.0 * math.pi / table.pulses,
            velocity=table.velocity.value(data, start) * table.radian_per_second,
            current=table.current.value(data, start) * table.ampere,
            voltage=table.voltage.value(data, start) * 0.1,
            temperature=float(table.temperature.value(data, start)),
            hardware_error=error,
            trouble=trouble,
        )

    def _look_after(self) -> str:
        """Read one of the registers that the torque hangs on when its turn has come, each once a second.

        Return what is wrong with it. A lost reply is no news: its turn comes again.
        """
        now = time.monotonic()
        if not self._expected or now - self._looked < LOOK / len(self._expected):
            return ""
        name, item, expected = self._expected[self._looks % len(self._expected)]
        self._looked = now
        try:
            value = self.bus.get(item)
        except NoReply:
            return ""
        self._looks += 1
        return "" if value == expected else f"{name} is {value}, expected {expected}"

    def _expect(self, torque: int, watchdog: int) -> None:
        """Note what the registers shall be from now on."""
        table = self._known
        kept = [("torque_enable", table.torque_enable, torque)]
        if torque:
            kept.append(("operating_mode", table.operating_mode, TORQUE_MODE))
            if table.bus_watchdog is not None:
                kept.append(("bus_watchdog", table.bus_watchdog, watchdog))
        self._expected = tuple(kept)

    def write(self, torque: float) -> None:
        """Command a torque (N m). Raises NoReply, PortLost, Refused."""
        if self._supervisor is not None:
            self._supervisor.beat(torque != 0.0)
        table = self._known
        self.bus.put(table.goal_torque, round(torque / self._settings.torque_constant / table.ampere))
        self._spared = self._port.left

    def torque_of(self, current: float) -> float:
        """Return the torque (N m) of a current (A)."""
        return current * self._settings.torque_constant

    def recover(self) -> None:
        """Open the port again if it is lost; raises DeviceError while the motor reports a hardware error."""
        try:
            self._known  # noqa: B018  a motor that was away when the port was opened again is not set up
            self.patiently(self.bus.ping)
        except DeviceError:
            self.close()
            self.open()
        self._supervise()
        error = self.patiently(lambda: self.bus.get(self._known.hardware_error))
        if error:
            raise DeviceError(f"motor: hardware error {error_names(error)}, expected a reboot first")

    def reboot(self) -> None:
        """Reboot the motor and set it up again. Raises DeviceError when it does not come back."""
        self.disable()
        self.patiently(self.bus.reboot)
        deadline = time.monotonic() + BOOT_TIME
        while True:
            time.sleep(BOOT_POLL)
            try:
                self.bus.ping()
                break
            except NoReply:
                if time.monotonic() > deadline:
                    raise
        self.close()
        self.open()

    def close(self) -> None:
        """Zero torque, off, port closed; where the motor does not acknowledge it the supervisor goes on."""
        safe = False
        try:
            if self.table is not None:
                self._stop()
                safe = True
        except DeviceError:
            safe = False  # the supervisor's turn
        finally:
            if self._supervisor is not None:
                self._supervisor.close(safe=safe)
                self._supervisor = None
            self.table = None
            self._port.close()

    def _stop(self) -> None:
        """Switch the torque off, then clear the watchdog: a tripped one refuses a new goal."""
        table = self._known
        self._expected = ()
        self._put(table.torque_enable, 0)
        if table.bus_watchdog is not None:
            self._put(table.bus_watchdog, 0)
        self._put(table.goal_torque, 0)

    def _supervise(self) -> None:
        """Start a supervisor for a motor without a watchdog, and a new one for one that is dead."""
        if self._supervisor is not None and not self._supervisor.alive():
            self._supervisor.close()
            self._supervisor = None
        if self._supervisor is None and self._known.bus_watchdog is None:
            self._supervisor = Supervisor(
                self._port.descriptor, self._settings.watchdog, self._stop_frames(), self._settings.supervisor
            )

    def _stop_frames(self) -> list[bytes]:
        """Return the frames that zero the torque and switch it off, for the supervisor."""
        table = self._known
        return [
            frame(self._settings.identity, bytes([WRITE, *item.address.to_bytes(2, "little"), *item.data(0)]))
            for item in (table.goal_torque, table.torque_enable)
        ]

    def patiently(self, transaction: Callable[[], T]) -> T:
        """Return what a transaction outside the cycle returns: it has time for several attempts."""
        usual, self._port.latency = self._port.latency, max(self._port.latency, PATIENCE)
        try:
            return _patient(transaction)
        finally:
            self._port.latency = usual

    def _put(self, item: Item, value: int) -> None:
        self.patiently(lambda: self.bus.put(item, value))


def _table(model: int, settings: Settings) -> ControlTable:
    """Return the control table of a model number. Raises DeviceError for one that is not expected."""
    where = f"motor ID {settings.identity} on {settings.path}"
    if model not in TABLES:
        raise DeviceError(f"{where}: model {model}, expected one of {', '.join(map(str, TABLES))}")
    if settings.model not in (0, model):
        raise DeviceError(f"{where}: model {model}, expected {settings.model} (parameter model)")
    return TABLES[model]


def _patient(transaction: Callable[[], T]) -> T:
    """Return what a transaction returns, tried again when a reply is lost."""
    for _ in range(ATTEMPTS - 1):
        try:
            return transaction()
        except NoReply:
            continue
    return transaction()
