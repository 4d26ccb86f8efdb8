"""Drag that grows with the square of the speed: oil that churns, air, a fan on the rotor.

    T = -coefficient · ω · |ω|

ω is the speed of the gear output against the housing. The step's torque is solved for with the speed that it
leaves in the middle of the step, so no drag is too strong for it. Source: Armstrong-Helouvry, Dupont, Canudas
de Wit, Automatica 30, 1994, section 2.
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, MOBILITY, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the drag; x[0] is that of the last step, which the speed in the middle already has."""
    half = 0.5 * s[MOBILITY]
    free = s[GEAR_VELOCITY] + half * x[0]
    w = 2.0 * free / (1.0 + math.sqrt(1.0 + 4.0 * half * p[0] * abs(free)))
    x[0] = p[0] * w * abs(w)
    s[GEAR_TORQUE] -= x[0]


EFFECT = Effect(
    name="quadratic_drag",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "coefficient", "N m s^2/rad^2", null=0.0, low=0.0, high=500.0, typical=12.0,
            reason="six times the largest torque, at the largest speed",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=2.0, passive=True),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    about="drag that grows with the square of the speed",
    inspect="oil level, fans, air or water that the joint moves",
)
