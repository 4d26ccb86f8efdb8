"""Limits that the motor holds itself, and registers that must not change."""

import math
import time
from dataclasses import dataclass

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.bus import Bus
from rsea_ros.hardware.dynamixel.control_tables import ControlTable, Item
from rsea_ros.hardware.limits import Limits

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
