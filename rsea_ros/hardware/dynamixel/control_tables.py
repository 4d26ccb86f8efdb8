"""Control tables of the motors, and the settings of one."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml

FOLDER = Path(__file__).with_name("models")
HARDWARE_ERRORS = ("voltage", "hall sensor", "overheating", "encoder", "electrical shock", "overload")
"""Bits of the hardware error status, from bit 0 on, of every series."""
_RPM = 2.0 * math.pi / 60.0
_MEASURED = ("position", "velocity", "current", "voltage", "temperature")


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
class TorqueConstant:
    """Torque at the output for a current, N m/A: value, and the least and largest of the sources."""

    value: float
    low: float
    high: float
    source: str

    def __str__(self) -> str:
        return f"{self.value:g} N·m/A ({self.low:g} to {self.high:g}: {self.source})"


@dataclass(frozen=True)
class ControlTable:
    """A motor's items, and the values of a count: A, rad/s, and pulses per revolution of the output.

    bus_watchdog, drive_mode, startup: None on a model without. watchdog_firmware: the first with
    the bus watchdog. torque_limit and goal_torque are currents; later series call them so.
    torque_constant: None without a source. no_load_speed: rad/s, at the highest voltage; inf: no source.
    zero: counts where the maker's ROS 2 packages, and URDFs, have 0 rad.
    """

    model: int
    name: str
    series: str
    items: Mapping[str, Item]
    ampere: float
    radian_per_second: float
    pulses: int
    torque_constant: TorqueConstant | None
    watchdog_firmware: int = 0
    no_load_speed: float = math.inf
    zero: int = 0

    def __getattr__(self, name: str) -> Item:
        try:
            return self.items[name]
        except KeyError:
            raise AttributeError(name) from None

    def optional(self, name: str) -> Item | None:
        """Return an item, None on a model without it."""
        return self.items.get(name)

    @property
    def count(self) -> float:
        """Rad of a pulse."""
        return 2.0 * math.pi / self.pulses

    @property
    def sample(self) -> tuple[int, int]:
        """First address and size of the one read with all measurements."""
        return self.span(_MEASURED)

    def span(self, names: tuple[str, ...]) -> tuple[int, int]:
        """Return first address and size of the one read that holds some items."""
        items = [self.items[name] for name in names if name in self.items]
        start = min(item.address for item in items)
        return start, max(item.address + item.size for item in items) - start


def error_names(status: int) -> str:
    """Return the names of the bits of a hardware error status."""
    return ", ".join(name for bit, name in enumerate(HARDWARE_ERRORS) if status >> bit & 1) or "none"


def _tables() -> dict[int, ControlTable]:
    tables = {}
    for path in sorted(FOLDER.glob("*.yaml")):
        series = strict_yaml.read(path).content
        items = {name: Item(at[0], at[1], at[2:] == ["signed"]) for name, at in series["items"].items()}
        for number, body in series["models"].items():
            tables[int(number)] = _table(int(number), path.stem, items, {**series, **body})
    return dict(sorted(tables.items()))


def _table(number: int, series: str, items: Mapping[str, Item], body: Mapping[str, Any]) -> ControlTable:
    constant = None
    if "torque_constant" in body:
        value, low, high = body["torque_constant"]
        constant = TorqueConstant(value, low, high, body["source"])
    return ControlTable(
        model=number,
        name=body["name"],
        series=series,
        items=items,
        ampere=body["ampere"],
        radian_per_second=body["rpm"] * _RPM,
        pulses=body["pulses"],
        torque_constant=constant,
        watchdog_firmware=body.get("watchdog_firmware", 0),
        no_load_speed=body.get("no_load_rpm", math.inf) * _RPM,
        zero=body.get("zero", 0),
    )


TABLES: Mapping[int, ControlTable] = _tables()
"""By model number."""


SHARE, REST = 0.4, 1e-4
"""What a reply may be late: part of a cycle, less so many s, half of what the rest of a cycle takes."""


@dataclass(frozen=True)
class MotorConnection:
    """Connection and model of the motor.

    baud: bit/s. model: number that is expected, 0 for any known. torque_constant: N m at the gear output
    per A, 0: that of the model's table. latency: allowance for adapter and scheduler beside the time on the
    wire, s; a reading may also use what the write before it has left. watchdog: s without the host after
    which the motor's own watchdog, or the supervisor, takes the torque away. supervisor: socket of one that
    runs as a service; empty: a child of this process. urdf_zero: angles are 0 where the table says that the
    maker's URDFs have it, not at the zero of the motor's counts.
    """

    path: str
    baud: int = 1_000_000
    identity: int = 1
    model: int = 0
    torque_constant: float = 0.0
    latency: float = 1e-3
    watchdog: float = 0.1
    supervisor: str = ""
    urdf_zero: bool = False


def usual_latency(rate: float, replies: int = 2) -> float:
    """Return the latency (s) with which a cycle that loses all its replies still ends in time. rate: Hz."""
    return max(2.0 * SHARE / replies / rate - REST, REST)
