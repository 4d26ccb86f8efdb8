"""The F/T sensor as a device, and values that stand still."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import Wrench
from rsea_ros.hardware.netft.calibration import Calibration, fetch
from rsea_ros.hardware.netft.receiver import SET_BIAS, Arrival, DatagramReceiver, trouble

LEAST, TIMES = 50_000_000, 10
"""ns of equal records that are no chance; multiple of the longest such time at rest that they exceed."""


class Stillness:
    """The last change of any of the six values.

    limit: ns without one that are a fault; inf before `calibrate`, and for a sensor without noise. stopped:
    whether it was exceeded.
    """

    def __init__(self) -> None:
        self.limit, self.stopped = math.inf, False
        self._counts: Sequence[int] = ()
        self._changed = 0

    def calibrate(self, arrivals: Sequence[Arrival]) -> None:
        """Learn from records at rest for how long the values repeat."""
        changes = _changes(arrivals)
        times = [after - before for before, after in pairwise(changes)]
        self.limit = max(LEAST, TIMES * max(times)) if times else math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the last values."""
        self.stopped, self._counts, self._changed = False, (), 0

    def take(self, arrivals: Sequence[Arrival]) -> str:
        """Process records; return the fault in words, '' for none."""
        for arrival in arrivals:
            if arrival.record.counts != self._counts:
                self._counts, self._changed = arrival.record.counts, arrival.instant
        unchanged = arrivals[-1].instant - self._changed if arrivals else 0
        self.stopped = self.stopped or unchanged > self.limit
        return _words(unchanged) if unchanged > self.limit else ""

    def reason(self, arrivals: Sequence[Arrival]) -> str:
        """Return the fault in records of a while without any change, '' for none."""
        lasted = arrivals[-1].instant - arrivals[0].instant
        return "" if len(_changes(arrivals)) > 1 or lasted <= self.limit / TIMES else _words(lasted)


def _changes(arrivals: Sequence[Arrival]) -> list[int]:
    """Return the instants of the first record and of each that differs from the one before it, ns."""
    first = [arrival.instant for arrival in arrivals[:1]]
    return first + [b.instant for a, b in pairwise(arrivals) if a.record.counts != b.record.counts]


def _words(unchanged: int) -> str:
    return f"all six values unchanged for {unchanged / 1e6:.0f} ms: the sensor has stopped"


AVERAGING_TIME, FIRST = 0.1, 3.0
"""s over which noise and tare are measured; s that the first record may take."""
QUIET_CYCLES = 3
TARED = 6.0
"""Standard deviations that the mean may be off after a tare: the bias is one record, with its noise."""
STREAM_AGAIN = 0.02
"""s until records come with the new bias."""
AXES = ("Fx in N", "Fy in N", "Fz in N", "Tx in N·m", "Ty in N·m", "Tz in N·m")

Values = NDArray[np.float64]


@dataclass(frozen=True)
class SensorConnection:
    """host, UDP port of RDT, TCP port of the web page; timeout: s without a record that are a fault."""

    host: str
    port: int = 49152
    page_port: int = 80
    timeout: float = 0.01
JUMPS = {"restarted": "the sensor was restarted", "frozen": "ft_sequence stands still"}


class ForceTorqueSensor:
    """One sensor. noise: standard deviation of each axis at rest, N and N m. low_pass: as its page says."""

    def __init__(self, settings: SensorConnection) -> None:
        self._settings = settings
        self._receiver = DatagramReceiver(settings.host, settings.port)
        self._calibration = Calibration(1.0, 1.0)
        self.noise: Wrench = (0.0,) * 6
        self.low_pass = ""
        self._quiet = 0
        self._stillness = Stillness()
        self._seen: Mapping[str, int] = {}

    def open(self) -> None:
        """Get the calibration, start the stream, measure the noise. Raises DeviceError."""
        self._calibration = fetch(self._settings.host, self._settings.page_port)
        self.low_pass = self._calibration.low_pass
        self._receiver.open()
        try:
            arrivals = self._collect()
        except DeviceError:
            self._receiver.close()
            raise
        self.noise = _six(self._values(arrivals).std(axis=0))
        self._stillness.calibrate(arrivals)
        self._restart_watch()

    @property
    def range(self) -> Wrench:
        """The largest values that it measures, N and N m; inf where its page states none."""
        return self._calibration.range

    def gather(self) -> None:
        """Fetch received records, so that the next `take` has little to do."""
        self._receiver.drain()

    def take(self) -> tuple[list[tuple[int, Wrench]], str]:
        """Return the records since the last call as (monotonic ns, wrench), and the fault: '' none."""
        arrivals = self._receiver.take()
        wrong = self._silence(arrivals) or self._jump() or _complaint(arrivals)
        wrong = wrong or self._stillness.take(arrivals)
        return [(a.instant, self._calibration.wrench(a.record.counts)) for a in arrivals], wrong

    def zero(self) -> None:
        """Let the sensor take its present load for zero. Raises DeviceError when the load is not at rest."""
        self._expect_small(np.ptp(self._values(self._collect()), axis=0), 2.0, "swings by", "before the tare")
        self._receiver.send(SET_BIAS)
        time.sleep(STREAM_AGAIN)
        self._expect_small(np.abs(self._values(self._collect()).mean(axis=0)), 1.0, "is", "after the tare")
        self._restart_watch()

    def _expect_small(self, values: Values, times: float, verb: str, when: str) -> None:
        """Raise DeviceError when an axis is beyond a multiple of the noise."""
        quantum = np.array([self._calibration.force] * 3 + [self._calibration.torque] * 3)
        limit = times * (TARED * np.array(self.noise) + quantum)
        axis = int(np.argmax(values / limit))
        if values[axis] > limit[axis]:
            expected = f"expected at most {limit[axis]:.3g}"
            raise DeviceError(f"F/T sensor: {AXES[axis]} {verb} {values[axis]:.3g} {when}, {expected}")

    def recover(self) -> None:
        """Return when the stream is sound, at once where it continues. Raises DeviceError otherwise."""
        stopped = ""
        if self._age() > self._settings.timeout * 1e9 or self._complains() or self._stillness.stopped:
            stopped = self._stillness.reason(self._collect())
        if complaint := self._complains() or stopped:
            raise DeviceError(f"F/T sensor: {complaint} is still there, expected it to be over")
        self._restart_watch()

    def _complains(self) -> str:
        """Return the error in the newest record."""
        self._receiver.drain()
        return _complaint([self._receiver.newest] if self._receiver.newest else [])

    def counts(self) -> dict[str, int]:
        """Return the counts of received and lost records, by kind."""
        return {**self._receiver.sequence.counts, **self._receiver.refused}

    def close(self) -> None:
        """End the stream."""
        self._receiver.close()

    def _values(self, arrivals: list[Arrival]) -> Values:
        """Return the wrenches, one a row."""
        return np.array([self._calibration.wrench(a.record.counts) for a in arrivals])

    def _collect(self) -> list[Arrival]:
        """Return the records of the next AVERAGING_TIME. Raises DeviceError without any."""
        deadline = time.monotonic() + FIRST
        while not self._receiver.collect(0.005):
            if time.monotonic() > deadline:
                where = f"{self._settings.host}:{self._settings.port}"
                raise DeviceError(f"F/T sensor {where}: no record within {FIRST:g} s, expected a stream")
        arrivals = self._receiver.collect(AVERAGING_TIME)
        if not arrivals:
            raise DeviceError(f"F/T sensor {self._settings.host}: the stream has ended, expected it to go on")
        return arrivals

    def _restart_watch(self) -> None:
        self._stillness.restart()
        self._quiet, self._seen = 0, dict(self._receiver.sequence.counts)

    def _silence(self, arrivals: list[Arrival]) -> str:
        self._quiet = 0 if arrivals else self._quiet + 1
        age = self._age()
        if self._quiet < QUIET_CYCLES or age < self._settings.timeout * 1e9:
            return ""
        return f"no record for {age / 1e6:.1f} ms, limit {1e3 * self._settings.timeout:g} ms"

    def _age(self) -> int:
        """Return how old the newest record is, ns; 0 before the first."""
        newest = self._receiver.newest
        return time.monotonic_ns() - newest.instant if newest else 0

    def _jump(self) -> str:
        """Return whether the sensor's own counter stood still or went back since it was last looked at."""
        counts = self._receiver.sequence.counts
        for kind, words in JUMPS.items():
            if counts[kind] > self._seen.get(kind, 0):
                return words
        return ""


def _complaint(arrivals: list[Arrival]) -> str:
    for arrival in arrivals:
        if kind := trouble(arrival.record.status):
            return f"{kind}, status 0x{arrival.record.status:08x}"
    return ""


def _six(values: Values) -> Wrench:
    fx, fy, fz, tx, ty, tz = (float(value) for value in values)
    return fx, fy, fz, tx, ty, tz
