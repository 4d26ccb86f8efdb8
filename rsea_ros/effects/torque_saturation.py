"""Motor torque that stops growing at a limit (of current, voltage or drive).

    T_motor = min(max(T_command, -limit), limit)

Source: Khalil, Nonlinear Systems, 2002, section 1.2.7.
"""

import math

from rsea_ros.effects._held import both_held, put_both
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import at_limits
from rsea_ros.effects.signal_table import CURRENT, CURRENT_BEFORE, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Clip the command."""
    before, after = both_held(s)
    put_both(s, min(max(before, -p[0]), p[0]), min(max(after, -p[0]), p[0]))
    s[CURRENT_BEFORE] = min(max(s[CURRENT_BEFORE], -p[0]), p[0])
    s[CURRENT] = min(max(s[CURRENT], -p[0]), p[0])


EFFECT = Effect(
    name="torque_saturation",
    port=Port.COMMAND,
    order=10,
    parameters=(
        Parameter(
            "limit", "N m", null=math.inf, low=0.5, high=200.0, typical=15.0, starts=(20.0, 10.0, 6.0),
            logarithmic=True,
            reason="from a sixtieth of the largest torque to more than it, where it does not act",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=None),
    function=apply,
    guesses=at_limits,
    tags=("limit",),
    about="motor torque that stops growing at a limit",
    inspect="current limit of drive and motor, the supply's limit, a limit in the driver's parameters",
)
