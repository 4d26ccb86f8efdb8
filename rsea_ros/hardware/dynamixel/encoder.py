"""An encoder on the motor's bus."""

import math
import time
from collections import Counter
from dataclasses import dataclass

from rsea_ros.hardware.bus_motor import Unwrapper
from rsea_ros.hardware.device import NoReply, State
from rsea_ros.hardware.dynamixel.bus import Bus, SerialPort

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

    def open(self, sample: State, *, absolute: bool) -> None:
        """Check that it answers. sample: the motor's. absolute: its zero counts. Raises NoReply, Refused."""
        self._zero = 0.0
        self._counts.restart()
        zero = self._bus.patiently(lambda: self.deflection(sample))
        self._zero = 0.0 if absolute else zero

    def deflection(self, sample: State) -> float:
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
        output = sample.position + 1e-9 * (instant - sample.stamp) * sample.velocity
        return output - angle - self._zero
