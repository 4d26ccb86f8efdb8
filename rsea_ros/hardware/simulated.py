"""The simulated actuator: its physics follow a clock, independently of reads and writes."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.limits import Rating
from rsea_ros.hardware.protection import PROCESS, Protection
from rsea_ros.model.drive import steps_per_sample
from rsea_ros.model.rig import Rig, Sensor
from rsea_ros.model.simulation import Filters, Sensors, build, run
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import FloatArray

SECOND = 1_000_000_000
WIDE = 4.0
"""Standard deviations of the encoder's noise that count as a step of it."""


class SimulatedDevice:
    """A rig behind the Device interface.

    The fixed step divides the period of `rate` (Hz). A torque written within a step acts from that instant
    on: the step uses the mean of the torques held in it. A reading is the end of the last whole step.
    clock: returns the time, ns since the epoch, without a jump; by default the monotonic clock with the
    system clock's time when the device is made. duration: over which drifts reach their full size, s.
    """

    protection = Protection(PROCESS)

    def __init__(
        self, rig: Rig, rate: float, *, seed: int = 0, noise: bool = True, duration: float = 60.0,
        clock: Callable[[], int] | None = None,
    ) -> None:  # fmt: skip
        self._rig, self._clock = rig, clock or _steady_clock()
        self._sensors = Sensors(rig if noise else replace(rig, sensors={}))
        self._rng = np.random.default_rng(seed)
        self._period, self._per_second = 1.0 / rate, rate * steps_per_sample(1.0 / rate)
        self._duration = duration
        self._build()
        self._start: int | None = None
        self._steps, self._torque = 0, 0.0
        self._writes: list[tuple[int, float]] = []
        run(self._machine, np.zeros(1), np.empty((1, len(OUTPUTS))))  # compiles while there is time

    @property
    def rating(self) -> Rating:
        """How coarse the rig's encoder is."""
        sensor = self._rig.sensors.get("position", Sensor())
        return Rating(count=sensor.quantum + WIDE * sensor.noise)

    def open(self) -> None:
        """Start at rest, now, also after a `close`."""
        if self._steps:
            self._build()
        self._steps, self._torque, self._writes = 0, 0.0, []
        self._start = self._clock()

    def _build(self) -> None:
        step = 1.0 / self._per_second
        self._machine, self._values = build(self._rig, step, self._duration), np.zeros(len(OUTPUTS))
        self._filters = Filters(self._rig, step, self._period, held=not self._machine.lags)

    def read(self) -> State:
        """Advance to now and measure."""
        self._advance()
        readings = self._sensors.read(self._values, self._rng, self._filters)
        position, velocity, torque, ft, deflection = readings.tolist()
        stamp = self._instant(self._steps)
        wrench = None if self._rig.rigid_spring else (0.0, 0.0, 0.0, 0.0, 0.0, ft)
        deflection = deflection if "deflection" in self._rig.sensors else math.nan
        return State(stamp, position, velocity, torque, stamp, wrench, deflection=deflection)

    def write(self, torque: float) -> None:
        """Hold a torque (N m) from now on. Raises DeviceError for one that is not finite."""
        if not math.isfinite(torque):
            raise DeviceError(f"torque of {torque} N·m, expected a finite value")
        self._writes.append((self._clock(), float(torque)))

    def enable(self) -> None:
        """Do nothing: there is no power stage to switch."""

    def disable(self) -> None:
        """Command zero torque."""
        self.write(0.0)

    def zero_ft(self) -> None:
        """Do nothing: the sensor has no offset to tare."""

    def recover(self) -> None:
        """Do nothing: the connection cannot be lost."""

    def reboot(self) -> None:
        """Command zero torque."""
        self.write(0.0)

    def health(self) -> Mapping[str, object]:
        """Return nothing: failures are not simulated here."""
        return {}

    def close(self) -> None:
        """Command zero torque and stop."""
        if self._start is not None:
            self.write(0.0)
            self._advance()
            self._start = None

    def _instant(self, steps: int) -> int:
        """Return the stamp at the end of a number of steps, ns."""
        if self._start is None:
            raise DeviceError("simulated device is not open")
        return self._start + round(steps * SECOND / self._per_second)

    def _advance(self) -> None:
        """Run all steps that are over by now."""
        first, begin = self._steps, self._instant(self._steps)
        count = int((self._clock() - begin) * self._per_second / SECOND + 1e-3)
        if count < 1:
            return
        held = self._held_torque(begin, count)
        out = np.empty((count, len(OUTPUTS)))
        run(self._machine, held, out, start=first / self._per_second)
        self._filters.apply(out)
        self._steps, self._values = first + count, out[-1]

    def _held_torque(self, begin: int, count: int) -> FloatArray:
        """Return the mean torque of each step from `begin` (ns) on, and keep the writes that come later."""
        held, last = np.full(count, self._torque), self._torque
        for k, (stamp, torque) in enumerate(self._writes):
            at = max(0.0, (stamp - begin) * self._per_second / SECOND)
            step = int(at)
            if step >= count:
                self._writes = self._writes[k:]
                break
            held[step] += (torque - last) * (step + 1 - at)
            held[step + 1 :] = last = torque
        else:
            self._writes = []
        self._torque = last
        return held


def _steady_clock() -> Callable[[], int]:
    """Return a clock with the system clock's time that goes on evenly when that is set."""
    epoch = time.time_ns() - time.monotonic_ns()
    return lambda: epoch + time.monotonic_ns()
