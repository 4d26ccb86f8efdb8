"""An encoder on the motor's bus, and the sample of one exchange."""

import math
import time
from collections import Counter
from dataclasses import dataclass

from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.bus import Bus
from rsea_ros.hardware.dynamixel.control_tables import ControlTable
from rsea_ros.hardware.dynamixel.port import SerialPort


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


SPRING, LINK = "spring", "link"
SIZE = 4
"""Bytes of the angle, little-endian, signed."""


@dataclass(frozen=True)
class EncoderConnection:
    """identity: on the bus. address: of the angle. pulses: counts of a turn, negative where they fall as the
    angle grows. place: SPRING, for one that measures the deflection, or LINK, for one that measures the angle
    of the spring's distal side relative to the housing. latency: as that of the motor, s.
    """

    identity: int
    address: int = 132
    pulses: float = 4096.0
    place: str = SPRING
    latency: float = 1e-3


class BusEncoder:
    """Reads the spring's deflection, one transaction a cycle. It counts from `open`, the spring at rest."""

    def __init__(self, settings: EncoderConnection, port: SerialPort) -> None:
        self._settings = settings
        self._bus = Bus(port, settings.identity, "encoder")
        self._bus.latency = settings.latency
        self._zero, self._longer, self._counts = 0.0, 0, Unwrapper()

    @property
    def errors(self) -> Counter[str]:
        """Failed transactions by kind."""
        return self._bus.errors

    def open(self, sample: MotorSample, *, absolute: bool) -> None:
        """Check that it answers. sample: of now. absolute: its zero counts. Raises NoReply, Refused."""
        self._zero = 0.0
        self._counts.restart()
        zero = self._bus.patiently(lambda: self.deflection(sample))
        self._zero = 0.0 if absolute else zero

    def deflection(self, sample: MotorSample) -> float:
        """Return the deflection (rad) just after a sample of the motor. Raises NoReply, Refused, PortLost.

        After a failure the next read is longer or shorter by a byte, as that of the motor. An angle of the
        link is subtracted from that of the gear output at its own instant.
        """
        begin = time.monotonic_ns()
        try:
            data = self._bus.read(self._settings.address, SIZE + self._longer)
        except NoReply:
            self._longer ^= 1
            raise
        instant = (begin + time.monotonic_ns()) // 2
        counts = self._counts.take(int.from_bytes(data[:SIZE], "little", signed=True))
        angle = counts * 2.0 * math.pi / self._settings.pulses
        if self._settings.place == SPRING:
            return angle - self._zero
        output = sample.position + 1e-9 * (instant - sample.instant) * sample.velocity
        return output - angle - self._zero
