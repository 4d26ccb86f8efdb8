"""Factors by which a channel may be off SI, each with its meaning. Tried, never guessed (gains.py)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsea_ros.model.rig import Rig

_TURN = 2.0 * math.pi
_ANGLES = {"deg": math.degrees(1.0), "mrad": 1e3, "rev": 1.0 / _TURN, "arcmin": 60.0 * math.degrees(1.0)}
_SPEEDS = {"rpm": 60.0 / _TURN, "deg/s": math.degrees(1.0), "rev/s": 1.0 / _TURN}
_TORQUES = {"mN m": 1e3, "N cm": 100.0, "kN m": 1e-3, "lbf in": 8.8507}
_UNITS = {"position": _ANGLES, "deflection": _ANGLES, "velocity": _SPEEDS}
SAME_NUMBER = {"mN m": "mN m or N mm"}
"""Units that a factor cannot distinguish."""


@dataclass(frozen=True)
class Factor:
    """A channel's value over the SI value at the gear output.

    unit: its unit; at_motor: on the motor's side.
    """

    value: float
    unit: str
    at_motor: bool = False

    @property
    def meaning(self) -> str:
        """Return `rpm at the motor`."""
        unit = SAME_NUMBER.get(self.unit, self.unit)
        return f"{unit} at the motor" if self.at_motor else unit


def factors(channel: str, rig: Rig) -> tuple[Factor, ...]:
    """Return the factors that a channel may have beside 1, the plain units first."""
    units = _UNITS.get(channel, _TORQUES)
    plain = [Factor(v, u) for u, v in units.items()]
    ratio = rig["gear.ratio"]
    if channel not in ("ft", "deflection") and ratio > 1.5:
        si = {"position": "rad", "velocity": "rad/s"}.get(channel, "N m")
        side = ratio if channel in _UNITS else 1.0 / ratio
        plain += [Factor(side, si, True), *(Factor(f.value * side, f.unit, True) for f in list(plain))]
    sensor = rig.sensors.get(channel)
    if sensor is not None and sensor.quantum > 0.0:
        plain.append(Factor(1.0 / sensor.quantum, "counts"))
    return tuple(plain)
