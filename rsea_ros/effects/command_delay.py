"""Command that takes effect later than its stamp says.

    T_motor(t) = T_command(t - delay)

A position loop's target is late: r(t) = target(t - delay). Commands are kept on the grid of the step; a delay
between two steps mixes two of them, which is the exact mean over the step of the held command.
Source: Astrom, Wittenmark, Computer-Controlled Systems, 1997, ch. 2 (systems with a time delay).
"""

import numpy as np

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, CURRENT, REFERENCE, STEP, TARGETED, Port

LENGTH = 1023
"""Commands kept: 60 ms at a step of 60 us."""
STARTED = 1 + LENGTH


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Put the command into the ring x[1:] and take out the delayed one; x[0] is where the next one goes.

    Before the first target a loop had the same target; before the first torque command there was no torque.
    """
    if p[0] == 0.0:
        return
    steps = min(p[0] / s[STEP], LENGTH - 2.0)
    whole, now = int(steps), int(x[0])
    part = steps - whole
    targeted = s[TARGETED] != 0.0
    if targeted and x[STARTED] == 0.0:
        for i in range(1, STARTED):
            x[i] = s[REFERENCE]
        x[STARTED] = 1.0
    x[1 + now] = s[REFERENCE] if targeted else s[COMMAND]
    newer, older = x[1 + (now - whole) % LENGTH], x[1 + (now - whole - 1) % LENGTH]
    x[0] = (now + 1) % LENGTH
    if targeted:
        s[REFERENCE] = newer + part * (older - newer)
    else:
        s[COMMAND], s[CURRENT] = newer + part * (older - newer), newer


EFFECT = Effect(
    name="command_delay",
    port=Port.COMMAND,
    parameters=(
        Parameter(
            "delay", "s", null=0.0, low=0.0, high=0.06, typical=5e-3, starts=(1e-3, 0.015, 0.03),
            is_fixed=True,
            reason="buses and drivers: one cycle at 1 kHz to three at 50 Hz; short steps store no more",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=1.0, confusable_with=("current_loop_lag", "gear_compliance")
    ),
    function=apply,
    states=2 + LENGTH,
    tags=("delay",),
    response=lambda p, s: np.exp(-p[0] * s),
    part="command",
    about="the command takes effect later than its stamp says",
)
