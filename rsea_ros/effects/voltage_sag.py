"""Torque limit that falls with speed: the back-EMF of the motor uses up the supply's voltage.

    -limit · (1 + ω / no_load_speed) ≤ T_motor ≤ limit · (1 - ω / no_load_speed)

limit is the torque at rest, ω the speed of the gear output against the housing. A supply that sags under
current, V = V_0 - R_b i, only makes the limit at rest smaller: the line stays straight. Source: Hughes,
Drury, Electric Motors and Drives, 2013, section 3.4 (torque-speed line at constant voltage).
"""

import math

from rsea_ros.effects._held import both_held, put_both
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import at_limits
from rsea_ros.effects.signal_table import CURRENT, CURRENT_BEFORE, OUTPUT_VELOCITY, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Clip the command at the speed of the middle of the step, by that of its start and of the one before."""
    w = s[OUTPUT_VELOCITY]
    share = (w + 0.5 * (w - x[0])) / p[1]
    x[0] = w
    if not math.isinf(p[0]):
        low, high = min(-p[0] * (1.0 + share), 0.0), max(p[0] * (1.0 - share), 0.0)
        before, after = both_held(s)
        put_both(s, min(max(before, low), high), min(max(after, low), high))
        s[CURRENT_BEFORE] = min(max(s[CURRENT_BEFORE], low), high)
        s[CURRENT] = min(max(s[CURRENT], low), high)


EFFECT = Effect(
    name="voltage_sag",
    port=Port.COMMAND,
    order=10,
    parameters=(
        Parameter(
            "limit", "N m", null=math.inf, low=0.5, high=200.0, typical=18.0, starts=(25.0, 12.0),
            logarithmic=True,
            reason="from a sixtieth of the largest torque to more than it, where it does not act",
        ),
        Parameter(
            "no_load_speed", "rad/s", null=math.inf, low=0.1, high=100.0, typical=1.5, logarithmic=True,
            reason="from a sixth of the largest speed to where it does not act",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=None, confusable_with=("torque_saturation",)),
    function=apply,
    states=1,
    guesses=at_limits,
    tags=("limit",),
    about="torque limit that falls with speed, by the supply's voltage",
    inspect="the supply's voltage under load, cable length and gauge, the battery's charge",
)  # fmt: skip
