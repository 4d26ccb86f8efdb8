"""What an extended model knows of friction, ripple and backlash, as torques to be added ahead of time.

Friction, mean over a hold in which the speed goes straight from w_0 to w_1 (effects/_friction.py has the
same):

    F w_c (ln cosh(w_1 / w_c) - ln cosh(w_0 / w_c)) / (w_1 - w_0),  F = coulomb + stribeck exp(-(w / w_s)^2)

Ripple, mean over a hold in which the rotor turns from a_0 to a_1:

    -amplitude sin(c a + phase) sinc(c (a_1 - a_0) / 2),  a = (a_0 + a_1) / 2

Backlash: the motor has to cross the gap where the torque changes sign. Inverse, smoothed over a part of the
torque that the spring takes for the gap (Tao, Kokotovic, Adaptive Control of Systems with Actuator and
Sensor Nonlinearities, 1996, ch. 3, where it jumps):

    way = gap / 2 tanh(T / (0.3 K_s gap))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from rsea_ros.effects._friction import mean_tanh
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig import Rig

SMOOTHING = 0.3
"""Of K_s gap. A sharper crossing takes more torque than helps: of 0.15 to 1 the best for 3 to 30 N m."""

_mean_tanh: Callable[[float, float, float], tuple[float, float]] = mean_tanh.py_func
"""Without its compiler: a controller that compiles in its first cycles is late."""

COMPENSATED = ("coulomb_friction", "stribeck_friction", "torque_ripple", "backlash")


@dataclass(frozen=True)
class Friction:
    """SI, as in the catalogue; creep: rad/s, below which friction fades."""

    coulomb: float
    stribeck: float
    stribeck_velocity: float
    creep: float

    def mean(self, start: float, end: float) -> float:
        """Return the torque that overcomes it, N m, mean over a hold. start, end: rad/s."""
        middle = 0.5 * (start + end)
        size = self.coulomb + self.stribeck * math.exp(-((middle / self.stribeck_velocity) ** 2))
        start, end = start / self.creep, end / self.creep
        return size * _mean_tanh(start, end, math.exp(-2.0 * abs(start)))[0]


@dataclass(frozen=True)
class Ripple:
    """amplitude: N m. cycles: in a radian of the gear output. phase: rad."""

    amplitude: float
    cycles: float
    phase: float

    def mean(self, start: float, end: float) -> float:
        """Return the torque that cancels it, N m, mean over a hold. start, end: gear output, rad."""
        half = 0.5 * self.cycles * (end - start)
        share = math.sin(half) / half if half != 0.0 else 1.0
        return -self.amplitude * share * math.sin(0.5 * self.cycles * (start + end) + self.phase)


@dataclass(frozen=True)
class Compensation:
    """What is compensated. gap: rad. gap_torque: N m, over which its crossing is spread."""

    frictions: tuple[Friction, ...] = ()
    ripples: tuple[Ripple, ...] = ()
    gap: float = 0.0
    gap_torque: float = 1.0

    def friction(self, start: float, end: float) -> float:
        """Return the torque against all friction, N m, mean over a hold."""
        return sum(f.mean(start, end) for f in self.frictions)

    def ripple(self, start: float, end: float) -> float:
        """Return the torque against all ripple, N m, mean over a hold."""
        return sum(r.mean(start, end) for r in self.ripples)

    def way(self, torque: float) -> float:
        """Return how far the gear output is ahead of the spring at a torque (N m), rad."""
        return 0.5 * self.gap * math.tanh(torque / self.gap_torque)


def compensation(rig: Rig, names: Iterable[str] = COMPENSATED) -> Compensation:
    """Return the compensation of those of the rig's effects that are among `names`."""
    effects = [
        (e.name, effect_named(e.name).vector(e.parameters)) for e in rig.effects if e.name in set(names)
    ]
    gap = sum(p[0] for name, p in effects if name == "backlash")
    turns = train_ratio(rig)
    return Compensation(
        frictions=tuple(_friction(name, p) for name, p in effects if name.endswith("friction")),
        ripples=tuple(Ripple(p[0], p[1] * turns, p[2]) for name, p in effects if name == "torque_ripple"),
        gap=gap,
        gap_torque=SMOOTHING * rig["spring.stiffness"] * gap if gap > 0.0 else 1.0,
    )


def _friction(name: str, p: tuple[float, ...]) -> Friction:
    return Friction(p[0], 0.0, 1.0, p[1]) if name == "coulomb_friction" else Friction(*p)
