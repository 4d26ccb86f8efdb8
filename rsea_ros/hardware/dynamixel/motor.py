"""A Dynamixel in torque (current) mode, in SI units: one read and one write a cycle, and its own limits."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.bus_motor import BusMotor, T
from rsea_ros.hardware.device import NoReply, PortLost, State
from rsea_ros.hardware.dynamixel import control_tables
from rsea_ros.hardware.dynamixel.bus import ALERT, Bus, SerialPort
from rsea_ros.hardware.dynamixel.control_tables import ControlTable, Item, MotorConnection, TorqueConstant
from rsea_ros.hardware.dynamixel.frames import frame
from rsea_ros.hardware.limits import Limits, Rating
from rsea_ros.hardware.protection import BUS_WATCHDOG, Protection, Supervised

REVERSED, ENABLED_BY_GOAL = 0x01, 0x08
"""Bits of the drive mode: the direction is turned round; a goal that is written switches the torque on."""
ENABLED_AT_START = 0x01
"""Bit of the startup configuration: the torque is on when the power comes."""
READ = (
    "firmware", "return_delay", "drive_mode", "operating_mode", "homing_offset", "temperature_limit",
    "max_voltage", "min_voltage", "torque_limit", "startup",
)  # fmt: skip


@dataclass(frozen=True)
class OwnLimits:
    """current A, temperature °C, voltages V, homing_offset rad. reversed: whether positive is clockwise."""

    firmware: int
    return_delay: int
    operating_mode: int
    current: float
    temperature: float
    lowest_voltage: float
    highest_voltage: float
    homing_offset: float
    reversed: bool


def own_limits(bus: Bus, table: ControlTable) -> OwnLimits:
    """Read the settings of the motor.

    Raises DeviceError, also for a motor whose torque is not switched by torque_enable alone.
    """
    start, size = table.span(READ)
    data = bus.patiently(lambda: bus.read(start, size))
    value = {name: table.items[name].value(data, start) for name in READ if name in table.items}
    for name, bit, reason in (
        ("drive_mode", ENABLED_BY_GOAL, "a goal that is written switches its torque on"),
        ("startup", ENABLED_AT_START, "its torque is on when the power comes"),
    ):
        if value.get(name, 0) & bit:
            without = value[name] & ~bit
            raise DeviceError(f"motor: {name} {value[name]}: {reason}, expected {without}, set in the motor")
    return OwnLimits(
        firmware=value["firmware"],
        return_delay=value["return_delay"],
        operating_mode=value["operating_mode"],
        current=value["torque_limit"] * table.ampere,
        temperature=float(value["temperature_limit"]),
        lowest_voltage=0.1 * value["min_voltage"],
        highest_voltage=0.1 * value["max_voltage"],
        homing_offset=value["homing_offset"] * 2.0 * math.pi / table.pulses,
        reversed=bool(value.get("drive_mode", 0) & REVERSED),
    )


def check_own_limits(limits: Limits, motor_limits: OwnLimits, name: str) -> None:
    """Compare the driver's limits with the motor's. Raises ParameterError that names all that do not fit."""
    wrong = []
    if limits.temperature > motor_limits.temperature:
        wrong.append(
            f"temperature_limit = {limits.temperature:g} °C, expected at most"
            f" {motor_limits.temperature:g} °C, where the motor switches itself off"
        )
    if "voltage" not in limits.derived and limits.voltage >= motor_limits.highest_voltage:
        wrong.append(
            f"voltage_limit = {limits.voltage:g} V, expected less than"
            f" {motor_limits.highest_voltage:.4g} V, the most that the motor takes"
            f" (it takes {motor_limits.lowest_voltage:.4g} V or more)"
        )
    if wrong:
        raise ParameterError(f"parameter {'; '.join(wrong)} ({name})")


LOOK, OVERDUE = 0.25, 0.2
"""s from one register to the next, three under torque; for which one may not answer. So a fault is latched
within a second, however long a cycle takes."""


class Watchlist:
    """Registers of one motor and the values that they shall have."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.expect()

    def expect(self, *registers: tuple[str, Item, int], every: float = LOOK) -> None:
        """Set the expected registers from now on: name, item, value; empty: nothing is checked.

        every: s, one of them in turn.
        """
        self._expected, self._every = list(registers), every
        self._due, self._asked = time.monotonic(), math.inf

    def look(self) -> str:
        """Read the register that is due, again in the next cycle if its reply is lost; return its fault."""
        now = time.monotonic()
        if not self._expected or now < self._due:
            return ""
        name, item, expected = self._expected[0]
        self._asked = min(self._asked, now)
        try:
            value = self._bus.get(item)
        except NoReply:
            late = now - self._asked
            return f"{name} could not be read for {late:.2g} s" if late > OVERDUE else ""
        self._due, self._asked = max(self._due + self._every, self._asked), math.inf
        self._expected.append(self._expected.pop(0))
        return "" if value == expected else f"{name} is {value}, expected {expected}"


TORQUE_MODE, ACKNOWLEDGE_ALL = 0, 2
RETURN_DELAY_UNIT = 2e-6
WATCHDOG_UNIT = 0.02
WRITE, STATUS = 0x03, 0x55
WHILE_OFF = 0.1
"""s after which it is looked at again whether a motor is still off."""


class Motor(BusMotor):
    """One motor on a port, of its own unless one is given, which is then opened and closed by its owner.

    torque_constant: N m/A of the counts, with its spread; limits: the motor's settings.
    """

    def __init__(self, settings: MotorConnection, port: SerialPort | None = None) -> None:
        super().__init__(
            f"motor ID {settings.identity} on {settings.path}", settings.watchdog, settings.supervisor
        )
        self._settings, self._shared = settings, port is not None
        self.port = port or SerialPort(settings.path, settings.baud, settings.latency)
        self.bus = Bus(self.port, settings.identity)
        self._watchlist = Watchlist(self.bus)
        self._longer, self._spared = 0, 0.0
        self._unanswered = -1
        self.table: ControlTable | None = None
        self.limits: OwnLimits | None = None
        self.torque_constant = TorqueConstant(math.nan, math.nan, math.nan, "")

    @property
    def control_table(self) -> ControlTable:
        """The table of an open motor. Raises PortLost."""
        if self.table is None:
            raise PortLost(f"motor on {self._settings.path}: not open")
        return self.table

    @property
    def rating(self) -> Rating:
        """Torque and current at its own limit, its speed without load, the range of its supply, a count."""
        own = self.limits
        if own is None:
            return Rating(math.nan)
        speed, supply = self.control_table.no_load_speed, (own.lowest_voltage, own.highest_voltage)
        torque, count = self.torque_of(own.current), self.control_table.count
        return Rating(torque, speed, math.inf, own.current, *supply, count)

    def check(self, limits: Limits) -> None:
        assert self.limits is not None
        check_own_limits(limits, self.limits, self.control_table.name)

    def _set_up(self) -> None:
        if not self._shared:
            self.port.open()
        self.table = table = _table(self._model(), self._settings)
        self.torque_constant = _constant(table, self._settings)
        self.bus.set(table.status_level, ACKNOWLEDGE_ALL)
        self.limits = own_limits(self.bus, table)
        self.protection = self._protection(table, self.limits)
        self.bus.return_delay = RETURN_DELAY_UNIT * self.limits.return_delay
        self._identify()
        self._supervise()

    def _identify(self) -> None:
        """See BusMotor. Raises DeviceError for another motor, or one with other settings."""
        table, found = self.control_table, {"model": self._model()}
        self._stop()
        self.limits = own_limits(self.bus, table)
        found |= asdict(self.limits)
        mode = found.pop("operating_mode")
        self._check_same(found)
        self._known = found
        if mode != TORQUE_MODE:
            self.bus.set(table.operating_mode, TORQUE_MODE)

    def _model(self) -> int:
        """Return the model number of the motor that answers. Raises DeviceError for another than before."""
        model = self.bus.patiently(self.bus.ping)
        self._check_same({"model": model})
        return model

    def _protection(self, table: ControlTable, limits: OwnLimits) -> Protection | Supervised:
        """Return the motor's own watchdog where model and firmware have one, else a supervisor."""
        if "bus_watchdog" in table.items and limits.firmware >= table.watchdog_firmware:
            return Protection(BUS_WATCHDOG, self._settings.watchdog)
        if isinstance(self.protection, Supervised):
            return self.protection
        return Supervised(self._settings.watchdog, self._settings.supervisor)

    def _switch_on(self) -> None:
        table = self.control_table
        self._identify()
        kept = [("torque_enable", table.torque_enable, 1)]
        kept.append(("operating_mode", table.operating_mode, TORQUE_MODE))
        if self._watched:
            armed = max(1, round(self._settings.watchdog / WATCHDOG_UNIT))
            self.bus.set(table.bus_watchdog, armed)
            kept.append(("bus_watchdog", table.bus_watchdog, armed))
        self.bus.set(table.torque_enable, 1)
        self._watchlist.expect(*kept)

    def read(self, meanwhile: Callable[[], None] | None = None) -> State:
        """Read all measurements once, see BusMotor. Raises Refused, too.

        After a failure the next read is longer or shorter by a byte: a reply that comes late has the wrong
        size and cannot be mistaken for the new one.
        """
        table = self.control_table
        start, size = table.sample
        begin, usual = time.monotonic_ns(), self.bus.latency
        self.bus.latency = usual + self._spared
        try:
            data = self.bus.read(start, size + self._longer, meanwhile)
        except NoReply:
            self._longer ^= 1
            raise
        finally:
            self.bus.latency, self._spared = usual, 0.0
            self.acknowledged_late = 0 <= self._unanswered < self.bus.handler.acknowledged
            self._unanswered = -1
        instant = (begin + time.monotonic_ns()) // 2
        return self.sample(data, instant)

    def sample(self, data: bytes, instant: int) -> State:
        """Return the reading with the motor's errors; watched registers are checked here in turn."""
        table = self.control_table
        error = control_tables.error_names(self.bus.get(table.hardware_error)) if self.bus.alert else ""
        trouble, start = "" if error else self._watchlist.look(), table.sample[0]
        counts = self._counts.take(table.position.value(data, start))
        counts -= table.zero if self._settings.urdf_zero else 0
        current = table.current.value(data, start) * table.ampere
        return State(
            stamp=instant,
            position=counts * table.count,
            velocity=table.velocity.value(data, start) * table.radian_per_second,
            motor_torque=self.torque_of(current),
            current=current,
            voltage=table.voltage.value(data, start) * 0.1,
            temperature=float(table.temperature.value(data, start)),
            hardware_error=error,
            motor_trouble=trouble,
        )

    def write(self, torque: float) -> None:
        try:
            self.bus.put(self.control_table.goal_torque, self.counts(torque))
        except NoReply:
            self._unanswered = self.bus.handler.acknowledged
            raise
        self._spared = self.port.time_left

    def counts(self, torque: float) -> int:
        """Return the goal for a torque (N m)."""
        return round(torque / self.torque_constant.value / self.control_table.ampere)

    def torque_of(self, current: float) -> float:
        """Return the torque (N m) of a current (A)."""
        return current * self.torque_constant.value

    def patiently(self, transaction: Callable[[], T]) -> T:
        return self.bus.patiently(transaction)

    def health(self) -> Mapping[str, object]:
        values: dict[str, object] = {f"bus_{kind}": n for kind, n in self.bus.errors.items()}
        if self.table is not None and self.limits is not None:
            values |= {
                "motor": self.table.name,
                "firmware": self.limits.firmware,
                "torque_limit_nm": f"{self.torque_limit:.4g}",
                "torque_constant": self.torque_constant,
                "homing_offset_rad": f"{self.limits.homing_offset:.6g}",
                "reversed": self.limits.reversed,
            }
        return values

    def _is_set_up(self) -> bool:
        return self.table is not None

    def _ping(self) -> None:
        self.bus.ping()

    def _complaint(self) -> str:
        error = self.bus.patiently(lambda: self.bus.get(self.control_table.hardware_error))
        return control_tables.error_names(error) if error else ""

    def _restart(self) -> None:
        self.bus.patiently(self.bus.reboot)

    def _end(self) -> None:
        self.table = None
        if not self._shared:
            self.port.close()

    def _stop(self) -> None:
        """Switch the torque off, then clear the watchdog: a tripped one refuses a new goal.

        From then on it is looked at whether somebody else on the line switches it on.
        """
        table = self.control_table
        self._watchlist.expect()
        self.bus.set(table.torque_enable, 0)
        if self._watched:
            self.bus.set(table.bus_watchdog, 0)
        self.bus.set(table.goal_torque, 0)
        self._watchlist.expect(("torque_enable", table.torque_enable, 0), every=WHILE_OFF)

    def _supervise(self) -> None:
        if isinstance(self.protection, Supervised):
            identity = self._settings.identity
            replies = [frame(identity, bytes([STATUS, error])) for error in (0, ALERT)]
            self.protection.guard(self.port.descriptor, stop_frames(self.control_table, identity), replies)


def stop_frames(table: ControlTable, identity: int) -> list[bytes]:
    """Return the frames that zero the torque of a motor and switch it off, for a supervisor."""
    return [
        frame(identity, bytes([WRITE, *item.address.to_bytes(2, "little"), *item.data(0)]))
        for item in (table.goal_torque, table.torque_enable)
    ]


def _table(model: int, settings: MotorConnection) -> ControlTable:
    """Return the control table of a model number. Raises DeviceError for one that is not expected."""
    where = f"motor ID {settings.identity} on {settings.path}"
    if model not in (known := control_tables.TABLES):
        raise DeviceError(f"{where}: model {model}, expected one of {', '.join(map(str, known))}")
    if settings.model not in (0, model):
        raise DeviceError(f"{where}: model {model}, expected {settings.model} (parameter model)")
    return known[model]


def _constant(table: ControlTable, settings: MotorConnection) -> TorqueConstant:
    """Return the torque constant that is set, else the table's. Raises ParameterError without either."""
    if settings.torque_constant:
        given = settings.torque_constant
        return TorqueConstant(given, given, given, "parameter torque_constant")
    if table.torque_constant is None:
        raise ParameterError(
            f"parameter torque_constant = 0, expected N·m/A: no source gives that of {table.name}"
        )
    return table.torque_constant
