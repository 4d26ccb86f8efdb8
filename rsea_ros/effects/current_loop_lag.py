"""Lag of the motor's current loop, first order.

    time_constant · Ṫ_motor + T_motor = T_command

The torque of a step is the exact mean of T_m over it for a command that is held. Source: Leonhard, Control of
Electrical Drives, 2001 (the closed current loop as a lag).
"""

import math

from rsea_ros.effects._held import both_held, put_lagged, until_change
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import STEP, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the command by the mean of the lagged one; x[0] is that at the end of the step."""
    if p[0] == 0.0:
        return
    u, (before, after), share = s[STEP] / p[0], both_held(s), until_change(s)
    changed = before + (x[0] - before) * math.exp(-share * u)
    end = after + (changed - after) * math.exp(-(1.0 - share) * u)
    put_lagged(s, changed, end, (end - x[0]) / u, (changed - x[0]) / u)
    x[0] = end


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
    tags=("lag",),
    response=lambda p, s: 1.0 / (p[0] * s + 1.0),
    about="first-order lag of the motor's current",
    inspect="gains and low-pass of the drive's current loop, a slew limit of the command in the drive",
)
