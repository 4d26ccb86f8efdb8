"""Lag of the motor's current loop, first order.

    time_constant · Ṫ_motor + T_motor = T_command

The torque of a step is the exact mean of T_m over it for a command that is held. Source: Leonhard, Control of
Electrical Drives, 2001 (the closed current loop as a lag).
"""

import math

from rsea_ros.effects._held import fade
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, CURRENT, STEP, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the command by the mean of the lagged one; x[0] is that at the end of the step."""
    if p[0] == 0.0:
        return
    command, behind = s[COMMAND], x[0] - s[COMMAND]
    u = s[STEP] / p[0]
    s[COMMAND] = command - behind * math.expm1(-u) / u
    x[0] = s[CURRENT] = command + behind * math.exp(-u)
    fade(s, p[0])


EFFECT = Effect(
    name="current_loop_lag",
    port=Port.COMMAND,
    order=20,
    parameters=(
        Parameter(
            "time_constant", "s", null=0.0, low=1e-5, high=0.1, typical=4e-3, starts=(1e-3, 0.015),
            logarithmic=True,
            reason="corners of 1.6 Hz to 16 kHz: no current loop is slower, and a faster one has no effect",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=1.0, confusable_with=("command_delay", "gear_compliance")
    ),
    function=apply,
    states=1,
    response=lambda p, s: 1.0 / (p[0] * s + 1.0),
    about="first-order lag of the motor's current",
)
