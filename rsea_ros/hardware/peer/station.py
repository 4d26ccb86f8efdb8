"""The simulated bench as one loop: serial line, F/T stream and requests, at their instants."""

from __future__ import annotations

import select
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from rsea_ros.hardware.peer.ft import ForceSensor
from rsea_ros.hardware.peer.peer_motor import EmulatedMotor, Mechanism
from rsea_ros.hardware.peer.serial_line import EmulatedBus

STILL = 10_000_000
"""ns between two turns from which on the bench itself was held up: it turns at least every TICK."""
TICK = 5_000_000
"""ns; the plant's steps until now are worked off whenever somebody looks, and at least so often."""


class Requests(Protocol):
    """Where requests come from."""

    descriptor: int
    pauses: deque[tuple[int, int]]

    def serve(self, now: int) -> bool:
        """Execute requests; return False when the bench shall end."""


class Station:
    """Runs until its requests say so. Clocks are monotonic, ns.

    Where the machine holds it up, it notes in the requests' `pauses` when that ended and how long it was: a
    real motor would not stop, and replies late for that reason are not the driver's fault.
    """

    def __init__(
        self,
        plants: Sequence[Mechanism],
        motors: Sequence[EmulatedMotor],
        bus: EmulatedBus,
        sensor: ForceSensor,
        requests: Requests,
    ) -> None:
        self._plants, self._motors, self._bus, self._sensor = plants, motors, bus, sensor
        self._requests = requests
        self._tick = 0

    def run(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        """Serve everybody."""
        turned = clock()
        while True:
            ready = self._wait(clock)
            now = clock()
            if now - turned > STILL:
                self._requests.pauses.append((now, now - turned))
            turned = now
            if self._bus.descriptor in ready:
                self._bus.serve(now)
            if self._sensor.descriptor in ready:
                self._sensor.serve(now)
            advanced = self._sensor.tick(now)
            self._bus.flush(now)
            for motor in self._motors:
                motor.serve(now)
            if now >= self._tick and not (advanced and len(self._plants) == 1):
                for plant in self._plants:
                    plant.read()
                advanced = True
            if advanced:
                self._tick = now + TICK
            if self._requests.descriptor in ready and not self._requests.serve(now):
                return

    def _wait(self, clock: Callable[[], int]) -> list[int]:
        due = min(filter(None, (self._tick, self._bus.next_due, self._sensor.next_due)), default=0)
        places = [self._sensor.descriptor, self._requests.descriptor]
        if self._bus.descriptor >= 0:
            places.append(self._bus.descriptor)
        ready, _, _ = select.select(places, (), (), max(0.0, (due - clock()) / 1e9))
        return ready
