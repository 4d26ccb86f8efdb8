"""The motors' control tables as the motor itself knows them: where an item lies, what may be written."""

from __future__ import annotations

from dataclasses import dataclass

EEPROM, RAM, READ_ONLY = "eeprom", "ram", "read only"
TABLE_SIZE = 1024


@dataclass(frozen=True)
class Register:
    """An item: address, size in bytes, access, range of what may be written, value after power-on, sign."""

    address: int
    size: int
    access: str
    low: int = 0
    high: int = 255
    start: int = 0
    signed: bool = False


@dataclass(frozen=True)
class Model:
    """A motor: its number, its items by name, and what a count is worth in A, rad/s and rad."""

    number: int
    registers: dict[str, Register]
    ampere: float
    radian_per_second: float
    counts_per_turn: int


_RPM = 2.0 * 3.141592653589793 / 60.0

_PRO = {
    "id": Register(7, 1, EEPROM, 0, 252, 1),
    "baud": Register(8, 1, EEPROM, 0, 8, 3),
    "return_delay": Register(9, 1, EEPROM, 0, 254, 250),
    "mode": Register(11, 1, EEPROM, 0, 4, 3),
    "torque_limit": Register(30, 2, EEPROM, 0, 1860, 620),
    "shutdown": Register(48, 1, EEPROM, 0, 63, 58),
    "torque_enable": Register(562, 1, RAM, 0, 1),
    "goal": Register(604, 2, RAM, -1860, 1860, signed=True),
    "position": Register(611, 4, READ_ONLY, signed=True),
    "velocity": Register(615, 4, READ_ONLY, signed=True),
    "current": Register(621, 2, READ_ONLY, signed=True),
    "voltage": Register(623, 2, READ_ONLY, start=240),
    "temperature": Register(625, 1, READ_ONLY, start=32),
    "status_level": Register(891, 1, RAM, 0, 2, 2),
    "hardware_error": Register(892, 1, READ_ONLY),
}

_PRO_A = {
    "id": Register(7, 1, EEPROM, 0, 252, 1),
    "baud": Register(8, 1, EEPROM, 0, 9, 3),
    "return_delay": Register(9, 1, EEPROM, 0, 254, 250),
    "mode": Register(11, 1, EEPROM, 0, 16, 3),
    "torque_limit": Register(38, 2, EEPROM, 0, 22740, 22740),
    "shutdown": Register(63, 1, EEPROM, 0, 63, 58),
    "torque_enable": Register(512, 1, RAM, 0, 1),
    "status_level": Register(516, 1, RAM, 0, 2, 2),
    "hardware_error": Register(518, 1, READ_ONLY),
    "watchdog": Register(546, 1, RAM, 0, 127, signed=True),
    "goal": Register(550, 2, RAM, -22740, 22740, signed=True),
    "tick": Register(568, 2, READ_ONLY),
    "current": Register(574, 2, READ_ONLY, signed=True),
    "velocity": Register(576, 4, READ_ONLY, signed=True),
    "position": Register(580, 4, READ_ONLY, signed=True),
    "voltage": Register(592, 2, READ_ONLY, start=240),
    "temperature": Register(594, 1, READ_ONLY, start=32),
}

MODELS = {
    54024: Model(54024, _PRO, 33.0 / 2048.0, 0.00199234 * _RPM, 501_923),
    54025: Model(54025, _PRO_A, 1e-3, 0.01 * _RPM, 1_003_846),
    2020: Model(2020, _PRO_A, 1e-3, 0.01 * _RPM, 1_003_846),
}
