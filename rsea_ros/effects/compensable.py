"""The compensation of an effect by a torque controller, by the law that the step runs.

Each law has the effect's parameters in order. The controller calls it in Python: a controller that compiles
in its first cycles is late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

Parameters = Sequence[float]


@dataclass(frozen=True)
class AgainstMotion:
    """A torque against the motion. mean: speeds of the gear output at both ends of a hold, rad/s, to N m.

    Positive against a positive speed: torque that the motor has to add.
    """

    mean: Callable[[Parameters, float, float], float]


@dataclass(frozen=True)
class OfRotorAngle:
    """A torque of the rotor's angle. mean: angles of the rotor at both ends of a hold, rad, to N m.

    Positive where it drives forward: torque that the motor has to subtract.
    """

    mean: Callable[[Parameters, float, float], float]


@dataclass(frozen=True)
class Gap:
    """A play that the motor has to cross where the torque changes sign. width: the whole gap, rad."""

    width: Callable[[Parameters], float]


Compensable = AgainstMotion | OfRotorAngle | Gap
