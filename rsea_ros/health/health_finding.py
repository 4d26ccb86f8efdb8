"""A finding of health: its code, its words, its settings, and those on sensors that stop or send no numbers.

Codes are permanent, because fault managers rely on them. A discarded code is never used again.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, IntArray

SAMPLES, TIME = 10, 0.05
"""Equal values, and s of them, that are no chance while something else moves."""
MOVED = 12.0
"""Standard deviations of its own noise by which another sensor must have moved meanwhile."""
SILENT = 1.0
"""s without a sample after which a sensor is missing."""
CHANNELS: Mapping[str, tuple[int, int]] = {"position": (STATE, 0), "motor_torque": (STATE, 1), "ft": (FT, 0)}

WITNESSES: Mapping[str, tuple[str, ...]] = {
    "position": ("ft", "command"), "motor_torque": ("command",), "ft": ("position", "command"),
}  # fmt: skip
"""What cannot move for long while a sensor stands still."""


@dataclass
class _Sensor:
    last: float = math.nan
    since: float = math.inf
    count: int = 0
    seen: float = -math.inf
    frozen: float = math.nan
    """s, since when; nan while it moves."""


class Sensors:
    """The present faults of a rig's sensors. bad_values: samples that were not numbers."""

    def __init__(self, rig: Rig) -> None:
        self.rig, self.bad_values = rig, 0
        self._noise = {n: max(s.noise, s.quantum, 1e-12) for n, s in rig.sensors.items()}
        self._noise["command"] = self._noise.get("motor_torque", self._noise.get("ft", 1e-3))
        self.begin()

    def begin(self) -> None:
        """Forget all measurements."""
        self._begin, self._now, self._silence = math.inf, -math.inf, 0.0
        self._spans: dict[str, list[tuple[float, float, float]]] = {}
        self._state = {name: _Sensor() for name in CHANNELS if name in self.rig.sensors}

    def take(self, t: FloatArray, kind: IntArray, values: FloatArray) -> None:
        """Process events, sorted."""
        if not len(t):
            return
        self._begin, self._now, self._silence = min(self._begin, float(t[0])), float(t[-1]), 0.0
        self._note("command", t[kind == COMMAND], values[kind == COMMAND, 0])
        for name, (of, column) in CHANNELS.items():
            self._note(name, t[kind == of], values[kind == of, column])
        for name, sensor in self._state.items():
            of, column = CHANNELS[name]
            self._follow(name, sensor, t[kind == of], values[kind == of, column])

    def hear_nothing(self, seconds: float) -> None:
        """Note how long ago by a steady clock the last event came: without events no stamp shows it."""
        self._silence = seconds

    @property
    def frozen(self) -> dict[str, float]:
        """Sensors that have stopped, and since when, s."""
        return {name: s.frozen for name, s in self._state.items() if not math.isnan(s.frozen)}

    @property
    def missing(self) -> dict[str, float]:
        """Sensors that send nothing, and since when, s."""
        last = {n: max(s.seen, self._begin) for n, s in self._state.items()}
        now = self._now + self._silence
        return {name: t for name, t in last.items() if now - t > SILENT}

    def _note(self, name: str, t: FloatArray, y: FloatArray) -> None:
        """Keep the range of a signal for as long as others may be compared with it."""
        finite = y[np.isfinite(y)]
        self.bad_values += len(y) - len(finite) if name in self._state and len(finite) else 0
        spans = self._spans.setdefault(name, [])
        if len(finite):
            spans.append((float(t[0]), float(finite.min()), float(finite.max())))
            del spans[:-40]

    def _follow(self, name: str, sensor: _Sensor, t: FloatArray, y: FloatArray) -> None:
        good = np.isfinite(y)
        t, y = t[good], y[good]
        if not len(y):
            return
        sensor.seen = float(t[-1])
        changes = np.flatnonzero(np.diff(y, prepend=sensor.last) != 0.0)
        if len(changes):
            sensor.since, sensor.count = float(t[changes[-1]]), len(y) - int(changes[-1])
            sensor.frozen = math.nan
        else:
            sensor.count += len(y)
        sensor.last = float(y[-1])
        long = sensor.count >= SAMPLES and sensor.seen - sensor.since >= TIME
        if long and math.isnan(sensor.frozen) and self._others_moved(name, sensor.since):
            sensor.frozen = sensor.since

    def _others_moved(self, name: str, since: float) -> bool:
        """Return whether something else moved by more than its noise since an instant, s."""
        for other in WITNESSES[name]:
            later = [span for span in self._spans.get(other, []) if span[0] >= since]
            moved = max((s[2] for s in later), default=0.0) - min((s[1] for s in later), default=0.0)
            if moved > self._needed_motion(name, other):
                return True
        return False

    def _needed_motion(self, name: str, other: str) -> float:
        """Return the motion of another signal, in its unit, from which this one must have moved too."""
        beside = MOVED * self._noise.get(other, 0.0)
        if name == "motor_torque" or other == "position":
            return beside
        stiffness = 0.0 if self.rig.rigid_spring else self.rig["spring.stiffness"]
        torque = MOVED * stiffness * self._noise.get("position", 0.0)
        friction = max((e.parameters.get("torque", 0.0) for e in self.rig.effects), default=0.0)
        return max(beside, torque if other == "ft" else torque + 3.0 * friction)


@dataclass(frozen=True)
class HealthFinding:
    """code: of codes.TABLE. name: parameter or channel. size, ci95: change against the model, in `unit`; nan
    where the code has no size. since: s, by the joint's stamps. confidence: probability, 0 to 1.
    """

    code: str
    name: str
    since: float
    confidence: float = 1.0
    unit: str = ""
    size: float = math.nan
    ci95: tuple[float, float] = (math.nan, math.nan)


UNEXPLAINED = "RSEA_UNEXPLAINED"


def sensor_findings(sensors: Sensors, jumps: int, late: int) -> list[HealthFinding]:
    """Return the findings on the sensors themselves. jumps: of the stamps. late: samples left out."""
    findings = [HealthFinding("RSEA_SENSOR_FROZEN", name, since) for name, since in sensors.frozen.items()]
    findings += [HealthFinding("RSEA_SENSOR_MISSING", name, since) for name, since in sensors.missing.items()]
    counts = {"no numbers": sensors.bad_values, "jumps of the stamps": jumps, "late samples": late}
    counted = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    return [*findings, HealthFinding("RSEA_BAD_DATA", counted, math.nan)] if counted else findings


class Code(NamedTuple):
    """A code: its meaning, and the unit of its size (empty without a size)."""

    name: str
    meaning: str
    size: str


TABLE = (
    Code("RSEA_STIFFNESS", "stiffness of the spring changed", "change, N·m/rad"),
    Code(
        "RSEA_FRICTION", "viscous or Coulomb friction of the gear changed",
        "change, N·m·s/rad, N·m, or of the factor of both, 1",
    ),
    Code("RSEA_BACKLASH", "backlash between gear and spring appeared or changed", "change of the gap, rad"),
    Code("RSEA_DELAY", "commands take effect later, or sooner, than before", "change, s"),
    Code("RSEA_FT_GAIN", "calibration of the F/T sensor changed", "change of the gain, 1"),
    Code("RSEA_FT_BIAS", "zero of the F/T sensor moved", "change, N·m"),
    Code("RSEA_TORQUE_CONSTANT", "the motor makes another torque from its current", "change of the gain, 1"),
    Code("RSEA_UNEXPLAINED", "the joint changed, but no single cause of this table explains the change", ""),
    Code("RSEA_SENSOR_FROZEN", "a sensor repeats one value while something else moves", ""),
    Code("RSEA_SENSOR_MISSING", "a sensor that the rig lists has sent nothing for a second", ""),
    Code("RSEA_BAD_DATA", "values that are not numbers, stamps that go back or jump", ""),
)  # fmt: skip
NAMES = tuple(code.name for code in TABLE)


@dataclass(frozen=True)
class WatchSettings:
    """rate: false alarms an hour. every: s between looks. learn: looks that show how the innovations scatter.
    fitted: looks that a cause is fitted to. hold: s, how long a command stays in force.
    """

    rate: float = 1e-3
    every: float = 3.0
    learn: int = 20
    fitted: int = 4
    hold: float = 0.05
