"""The measurements of one read of a motor, in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsea_ros.hardware.dynamixel.control_tables import ControlTable


class Unwrapper:
    """Counts of an encoder that go on where their 4 bytes wrap round."""

    def __init__(self) -> None:
        self._last: int | None = None

    def restart(self) -> None:
        """Take the next counts as they are."""
        self._last = None

    def take(self, counts: int) -> int:
        """Return the counts nearest to the last ones, modulo 2^32."""
        last = counts if self._last is None else self._last
        self._last = last + (counts - last + (1 << 31)) % (1 << 32) - (1 << 31)
        return self._last


@dataclass(frozen=True)
class MotorSample:
    """instant: middle of the transaction, monotonic ns. counts: of the encoder. position rad, velocity rad/s,
    current A, voltage V, temperature °C.

    hardware_error: errors that the motor reports. trouble: wrong values of its registers, in words.
    """

    instant: int
    counts: int
    position: float
    velocity: float
    current: float
    voltage: float
    temperature: float
    hardware_error: str = ""
    trouble: str = ""


def sample_of(
    table: ControlTable, data: bytes, instant: int, hardware_error: str = "", trouble: str = ""
) -> MotorSample:
    """Return the measurements in the bytes of `table.sample`; further bytes are ignored."""
    start = table.sample[0]
    counts = table.position.value(data, start)
    return MotorSample(
        instant=instant,
        counts=counts,
        position=counts * 2.0 * math.pi / table.pulses,
        velocity=table.velocity.value(data, start) * table.radian_per_second,
        current=table.current.value(data, start) * table.ampere,
        voltage=table.voltage.value(data, start) * 0.1,
        temperature=float(table.temperature.value(data, start)),
        hardware_error=hardware_error,
        trouble=trouble,
    )
