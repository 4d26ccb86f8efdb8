"""The control tables in the motors: addresses of items and permitted values."""

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
class MotorModel:
    """A motor: its number, its items by name, and the value of a count in A, rad/s and rad.

    constant: N m at the output per A, as this motor has it.
    """

    number: int
    registers: dict[str, Register]
    ampere: float
    radian_per_second: float
    counts_per_turn: int
    constant: float = 6.826


_ANY = -(2**31), 2**31 - 1
"""What 4 bytes with a sign can say."""
_RPM = 2.0 * 3.141592653589793 / 60.0

_PRO = {
    "id": Register(7, 1, EEPROM, 0, 252, 1),
    "baud": Register(8, 1, EEPROM, 0, 8, 3),
    "return_delay": Register(9, 1, EEPROM, 0, 254, 250),
    "mode": Register(11, 1, EEPROM, 0, 4, 3),
    "homing_offset": Register(13, 4, EEPROM, *_ANY, signed=True),
    "temperature_limit": Register(21, 1, EEPROM, 0, 100, 80),
    "max_voltage": Register(22, 2, EEPROM, 0, 400, 400),
    "min_voltage": Register(24, 2, EEPROM, 0, 400, 150),
    "torque_limit": Register(30, 2, EEPROM, 0, 1860, 620),
    "shutdown": Register(48, 1, EEPROM, 0, 63, 58),
    "torque_enable": Register(562, 1, RAM, 0, 1),
    "goal_position": Register(596, 4, RAM, *_ANY, signed=True),
    "goal_velocity": Register(600, 4, RAM, *_ANY, signed=True),
    "goal": Register(604, 2, RAM, -1860, 1860, signed=True),
    "position": Register(611, 4, READ_ONLY, signed=True),
    "velocity": Register(615, 4, READ_ONLY, signed=True),
    "current": Register(621, 2, READ_ONLY, signed=True),
    "voltage": Register(623, 2, READ_ONLY, start=240),
    "temperature": Register(625, 1, READ_ONLY, start=32),
    "status_level": Register(891, 1, RAM, 0, 2, 2),
    "hardware_error": Register(892, 1, READ_ONLY),
}

_COMMON = {
    "id": Register(7, 1, EEPROM, 0, 252, 1),
    "return_delay": Register(9, 1, EEPROM, 0, 254, 250),
    "drive_mode": Register(10, 1, EEPROM, 0, 13),
    "mode": Register(11, 1, EEPROM, 0, 16, 3),
    "homing_offset": Register(20, 4, EEPROM, *_ANY, signed=True),
    "temperature_limit": Register(31, 1, EEPROM, 0, 100, 80),
    "startup": Register(60, 1, EEPROM, 0, 3),
}
"""Of X and P."""

_PRO_A = _COMMON | {
    "baud": Register(8, 1, EEPROM, 0, 9, 3),
    "max_voltage": Register(32, 2, EEPROM, 150, 350, 350),
    "min_voltage": Register(34, 2, EEPROM, 150, 350, 150),
    "torque_limit": Register(38, 2, EEPROM, 0, 22740, 22740),
    "shutdown": Register(63, 1, EEPROM, 0, 63, 58),
    "torque_enable": Register(512, 1, RAM, 0, 1),
    "status_level": Register(516, 1, RAM, 0, 2, 2),
    "hardware_error": Register(518, 1, READ_ONLY),
    "watchdog": Register(546, 1, RAM, 0, 127, signed=True),
    "goal_pwm": Register(548, 2, RAM, -2009, 2009, signed=True),
    "goal": Register(550, 2, RAM, -22740, 22740, signed=True),
    "goal_velocity": Register(552, 4, RAM, *_ANY, signed=True),
    "goal_position": Register(564, 4, RAM, *_ANY, signed=True),
    "tick": Register(568, 2, READ_ONLY),
    "current": Register(574, 2, READ_ONLY, signed=True),
    "velocity": Register(576, 4, READ_ONLY, signed=True),
    "position": Register(580, 4, READ_ONLY, signed=True),
    "voltage": Register(592, 2, READ_ONLY, start=240),
    "temperature": Register(594, 1, READ_ONLY, start=32),
}


_X330 = {
    "baud": Register(8, 1, EEPROM, 0, 6, 1),
    "temperature_limit": Register(31, 1, EEPROM, 0, 100, 70),
}
"""Of X330 and X335, unlike other X."""
_X330_M = _X330 | {"min_voltage": Register(34, 2, EEPROM, 31, 70, 35)}
_XL330 = _X330_M | {
    "drive_mode": Register(10, 1, EEPROM, 0, 5),
    "shutdown": Register(63, 1, EEPROM, 0, 63, 53),
}


def _x(current: int, voltage: tuple[int, int, int]) -> dict[str, Register]:
    """Return the table of an X motor: its largest current; lowest, highest and present voltage, 0.1 V."""
    low, high, now = voltage
    return _COMMON | {
        "baud": Register(8, 1, EEPROM, 0, 7, 1),
        "homing_offset": Register(20, 4, EEPROM, -1_044_479, 1_044_479, signed=True),
        "max_voltage": Register(32, 2, EEPROM, low, high, high),
        "min_voltage": Register(34, 2, EEPROM, low, high, low),
        "torque_limit": Register(38, 2, EEPROM, 0, current, current),
        "shutdown": Register(63, 1, EEPROM, 0, 63, 52),
        "torque_enable": Register(64, 1, RAM, 0, 1),
        "status_level": Register(68, 1, RAM, 0, 2, 2),
        "hardware_error": Register(70, 1, READ_ONLY),
        "watchdog": Register(98, 1, RAM, 0, 127, signed=True),
        "goal_pwm": Register(100, 2, RAM, -885, 885, signed=True),
        "goal": Register(102, 2, RAM, -current, current, signed=True),
        "goal_velocity": Register(104, 4, RAM, *_ANY, signed=True),
        "goal_position": Register(116, 4, RAM, *_ANY, signed=True),
        "tick": Register(120, 2, READ_ONLY),
        "current": Register(126, 2, READ_ONLY, signed=True),
        "velocity": Register(128, 4, READ_ONLY, signed=True),
        "position": Register(132, 4, READ_ONLY, signed=True),
        "voltage": Register(144, 2, READ_ONLY, start=now),
        "temperature": Register(146, 1, READ_ONLY, start=32),
    }


_V12, _V24, _V5, _V11 = (95, 160, 120), (110, 300, 240), (31, 70, 50), (55, 140, 111)
"""Lowest, highest and present voltage, 0.1 V."""


def _models() -> dict[int, MotorModel]:
    """Return every motor of the X, MX and P series and the Pro, with the constant that a count is worth."""
    made = {54024: MotorModel(54024, _PRO, 33.0 / 2048.0, 0.00199234 * _RPM, 501_923)}
    for number, turn, constant in (
        (2000, 607_500, 9.143), (2010, 1_003_846, 6.424), (2020, 1_003_846, 6.826), (2100, 526_374, 2.8),
        (2110, 502_834, 6.724), (2120, 502_834, 5.771), (43289, 526_374, 2.8), (46097, 502_834, 6.724),
        (46353, 502_834, 5.771), (51201, 607_500, 9.143), (53769, 1_003_846, 6.424),
        (54025, 1_003_846, 6.826),
    ):  # fmt: skip
        made[number] = MotorModel(number, _PRO_A, 1e-3, 0.01 * _RPM, turn, constant)
    for number, unit, current, voltage, constant in (
        (1000, 2.69e-3, 648, _V12, 2.615), (1010, 2.69e-3, 648, _V12, 1.923),
        (1020, 2.69e-3, 1193, _V12, 1.783), (1030, 2.69e-3, 1193, _V12, 1.304),
        (1040, 1.34e-3, 689, _V24, 4.714), (1050, 1.34e-3, 689, _V24, 3.714),
        (1100, 2.69e-3, 2047, _V12, 2.020), (1110, 2.69e-3, 2047, _V12, 1.449),
        (1120, 2.69e-3, 2047, _V12, 2.409), (1130, 2.69e-3, 2047, _V12, 1.659),
        (1140, 2.69e-3, 2047, _V24, 3.833), (1150, 2.69e-3, 2047, _V24, 2.667),
        (1170, 2.69e-3, 2047, _V12, 1.939), (1180, 2.69e-3, 2047, _V12, 1.408),
        (1001, 2.69e-3, 648, _V12, 2.6), (1011, 2.69e-3, 648, _V12, 1.9), (1101, 2.69e-3, 2047, _V12, 2.0),
        (1111, 2.69e-3, 2047, _V12, 1.4), (1270, 2.69e-3, 2047, _V12, 2.0), (1280, 2.69e-3, 2047, _V12, 1.4),
        (1310, 2.69e-3, 1188, _V24, 3.5),
    ):  # fmt: skip
        made[number] = MotorModel(number, _x(current, voltage), unit, 0.229 * _RPM, 4096, constant)
    for number, current, voltage, constant, other in (
        (1190, 1750, _V5, 0.1463, _XL330), (1200, 1750, _V5, 0.3537, _XL330), (1210, 910, _V11, 0.95, _X330),
        (1220, 910, _V11, 1.15, _X330), (1230, 2352, _V5, 0.3333, _X330_M),
        (1240, 2352, _V5, 0.5167, _X330_M), (1710, 910, _V11, 1.1, _X330),
    ):  # fmt: skip
        made[number] = MotorModel(number, _x(current, voltage) | other, 1e-3, 0.229 * _RPM, 4096, constant)
    for number, current, constant in ((311, 1941, 1.463), (321, 2047, 1.615)):
        registers = {name: each for name, each in _x(current, _V12).items() if name != "startup"}
        made[number] = MotorModel(number, registers, 3.36e-3, 0.229 * _RPM, 4096, constant)
    return made


MODELS = _models()
ENCODER = MotorModel(1, {
    "id": Register(7, 1, EEPROM, 0, 252, 1),
    "return_delay": Register(9, 1, EEPROM, 0, 254),
    "homing_offset": Register(20, 4, EEPROM, *_ANY, signed=True),
    "status_level": Register(68, 1, RAM, 0, 2, 2),
    "hardware_error": Register(70, 1, READ_ONLY),
    "position": Register(132, 4, READ_ONLY, signed=True),
}, 0.0, 0.0, 1 << 20)  # fmt: skip
"""A microcontroller with an encoder of 20 bits, whose angle is where an X motor has its position."""
