"""Compensation of an extended model's friction, ripple and backlash by torques added ahead of time.

Each law is that of the effect's file (Effect.compensation), mean over a hold in which the speed goes linearly
from w_0 to w_1, or the rotor turns from a_0 to a_1.

Backlash: the motor has to cross the gap where the torque changes sign. Inverse, smoothed over a part of the
torque that deflects the spring by the gap (Tao, Kokotovic, Adaptive Control of Systems with Actuator and
Sensor Nonlinearities, 1996, ch. 3, where it jumps):

    way = gap / 2 tanh(T / (0.3 K_s gap))
"""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import AgainstMotion, Gap, OfRotorAngle
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig import Rig

SMOOTHING = 0.3
"""Of K_s gap. A sharper crossing takes more torque than helps: of 0.15 to 1 the best for 3 to 30 N m."""

_OverHold = Callable[[float, float], float]


@dataclass(frozen=True)
class Compensation:
    """The compensated effects. gap: rad. gap_torque: N m, over which its crossing is spread.

    frictions: from speeds of the gear output at both ends of a hold, rad/s, to the friction torque, N m.
    ripples: from angles of the rotor, rad, to the ripple torque, N m. turns: of the rotor for one of the gear
    output.
    """

    frictions: tuple[_OverHold, ...] = ()
    ripples: tuple[_OverHold, ...] = ()
    turns: float = 1.0
    gap: float = 0.0
    gap_torque: float = 1.0

    def friction(self, start: float, end: float) -> float:
        """Return the torque against all friction, N m, mean over a hold. start, end: rad/s."""
        return sum(f(start, end) for f in self.frictions)

    def ripple(self, start: float, end: float) -> float:
        """Return the torque against all ripple, N m, mean over a hold. start, end: gear output, rad."""
        return -sum(r(self.turns * start, self.turns * end) for r in self.ripples)

    def way(self, torque: float) -> float:
        """Return how far the gear output is ahead of the spring at a torque (N m), rad."""
        return 0.5 * self.gap * math.tanh(torque / self.gap_torque)


def compensation(rig: Rig, names: Collection[str] | None = None) -> Compensation:
    """Return the compensation of the rig's effects that have a law for it, or of those in `names`."""
    effects = [(effect_named(e.name), e.parameters) for e in rig.effects if names is None or e.name in names]
    laws = [(effect.compensation, effect.vector(parameters)) for effect, parameters in effects]
    gap = sum(law.width(p) for law, p in laws if isinstance(law, Gap))
    return Compensation(
        frictions=tuple(partial(law.mean, p) for law, p in laws if isinstance(law, AgainstMotion)),
        ripples=tuple(partial(law.mean, p) for law, p in laws if isinstance(law, OfRotorAngle)),
        turns=train_ratio(rig),
        gap=gap,
        gap_torque=SMOOTHING * rig["spring.stiffness"] * gap if gap > 0.0 else 1.0,
    )
