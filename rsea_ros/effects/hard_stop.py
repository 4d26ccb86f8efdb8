"""Stop in the spring: beyond an angle it meets something stiff.

    T_s = K_s · d + stiffness · (|d| - angle) · sign(d) for |d| > angle

The stop sits beside the spring, so the F/T sensor sees its torque too. Source: Gilardi, Sharf, Literature
survey of contact dynamics modelling, Mech. Mach. Theory 37, 2002 (contact as a spring).
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import at_ends_of_travel
from rsea_ros.effects.signal_table import DEFLECTION, SPRING_TORQUE, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the torque of the stop."""
    beyond = abs(s[DEFLECTION]) - p[0]
    if beyond > 0.0:
        s[SPRING_TORQUE] += p[1] * math.copysign(beyond, s[DEFLECTION])


EFFECT = Effect(
    name="hard_stop",
    port=Port.SPRING,
    parameters=(
        Parameter(
            "angle", "rad", null=math.inf, low=5e-4, high=0.1, typical=8e-3, starts=(4e-3, 0.015),
            logarithmic=True,
            reason="from a fortieth of the deflection at the largest torque to five times it",
        ),
        Parameter(
            "stiffness", "N m/rad", null=0.0, low=50.0, high=1e5, typical=5e3, starts=(1e3, 3e4),
            logarithmic=True,
            reason="from a thirtieth of the spring's to seventy times it, which is nearly rigid",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=None, passive=True, confusable_with=("nonlinear_spring",)
    ),
    function=apply,
    reads=(DEFLECTION,),
    guesses=at_ends_of_travel,
    about="a stop that the spring meets beyond an angle",
    inspect="end stops, springs that are fully compressed, a cable or a cover in the way",
)
