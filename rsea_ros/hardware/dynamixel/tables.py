"""Control tables of the motors that the driver knows, by model number. Source: facts.md section 4."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

_RPM = 2.0 * math.pi / 60.0


@dataclass(frozen=True)
class Item:
    """An item of a control table: address and size in bytes; little-endian, signed in two's complement."""

    address: int
    size: int
    signed: bool = False

    def value(self, data: bytes, start: int = 0) -> int:
        """Return the item from bytes that were read from `start` on."""
        at = self.address - start
        return int.from_bytes(data[at : at + self.size], "little", signed=self.signed)

    def data(self, value: int) -> list[int]:
        """Return a value as the bytes to write. Raises OverflowError when it does not fit."""
        return list(value.to_bytes(self.size, "little", signed=self.signed))


@dataclass(frozen=True)
class ControlTable:
    """A motor's items, and what counts are worth: A, rad/s, and pulses per revolution.

    bus_watchdog, tick: None on the model that has none. sample: first address and size of the one read that
    holds everything that is measured; spare: bytes more that may be read with it.
    """

    model: int
    name: str
    return_delay: Item
    operating_mode: Item
    torque_limit: Item
    torque_enable: Item
    goal_torque: Item
    position: Item
    velocity: Item
    current: Item
    voltage: Item
    temperature: Item
    hardware_error: Item
    status_level: Item
    bus_watchdog: Item | None
    sample: tuple[int, int]
    ampere: float
    radian_per_second: float
    pulses: int


H54 = ControlTable(
    model=54024,
    name="H54-200-S500-R",
    return_delay=Item(9, 1),
    operating_mode=Item(11, 1),
    torque_limit=Item(30, 2),
    torque_enable=Item(562, 1),
    goal_torque=Item(604, 2, signed=True),
    position=Item(611, 4, signed=True),
    velocity=Item(615, 4, signed=True),
    current=Item(621, 2, signed=True),
    voltage=Item(623, 2),
    temperature=Item(625, 1),
    hardware_error=Item(892, 1),
    status_level=Item(891, 1),
    bus_watchdog=None,
    sample=(611, 15),
    ampere=33.0 / 2048.0,
    radian_per_second=0.00199234 * _RPM,
    pulses=501_923,
)


def _second_generation(model: int, name: str) -> ControlTable:
    return ControlTable(
        model=model,
        name=name,
        return_delay=Item(9, 1),
        operating_mode=Item(11, 1),
        torque_limit=Item(38, 2),
        torque_enable=Item(512, 1),
        goal_torque=Item(550, 2, signed=True),
        position=Item(580, 4, signed=True),
        velocity=Item(576, 4, signed=True),
        current=Item(574, 2, signed=True),
        voltage=Item(592, 2),
        temperature=Item(594, 1),
        hardware_error=Item(518, 1),
        status_level=Item(516, 1),
        bus_watchdog=Item(546, 1, signed=True),
        sample=(574, 21),
        ampere=1e-3,
        radian_per_second=0.01 * _RPM,
        pulses=1_003_846,
    )


TABLES: Mapping[int, ControlTable] = MappingProxyType(
    {
        54024: H54,
        54025: _second_generation(54025, "H54-200-S500-R(A)"),
        2020: _second_generation(2020, "PH54-200-S500-R"),
    }
)

HARDWARE_ERRORS = ("voltage", "hall sensor", "overheating", "encoder", "electrical shock", "overload")
"""Bits of the hardware error status, from bit 0 on."""


def error_names(status: int) -> str:
    """Return the names of the bits of a hardware error status."""
    return ", ".join(name for bit, name in enumerate(HARDWARE_ERRORS) if status >> bit & 1) or "none"
