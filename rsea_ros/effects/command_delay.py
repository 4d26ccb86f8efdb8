"""Command that takes effect later than its stamp says.

    T_motor(t) = T_command(t - delay)

A position loop's target is late: r(t) = target(t - delay). Commands are kept on the grid of the step; a delay
between two steps takes the end of one and the beginning of the next, to the exact mean of what is held.
Source: Astrom, Wittenmark, Computer-Controlled Systems, 1997, ch. 2 (systems with a time delay).
"""

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.effects._held import put_beside
from rsea_ros.effects._time import LENGTH
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import AFTER, COMMAND, HELD, REFERENCE, STEP, TARGETED, Port

ENDS, MEANS = 1, 1 + LENGTH
STARTED = 1 + 2 * LENGTH


@njit(inline="always")
def _until(before, after, mean):  # type: ignore[no-untyped-def]
    """Return the share of a step until a command changes, from one held value to another."""
    return min(max((after - mean) / (after - before), 0.0), 1.0) if after != before else 0.0


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Put what a step ends with and its mean into the rings, and take out both of the delayed step.

    x[0] is where the next one goes. Before the first target a loop had the same target; before the first
    torque command there was no torque.
    """
    if p[0] == 0.0:
        return
    steps = min(p[0] / s[STEP], LENGTH - 3.0)
    whole, now = int(steps), int(x[0])
    part = steps - whole
    targeted = s[TARGETED] != 0.0
    if targeted and x[STARTED] == 0.0:
        for i in range(ENDS, STARTED):
            x[i] = s[REFERENCE]
        x[STARTED] = 1.0
    x[ENDS + now] = s[REFERENCE] if targeted else s[COMMAND] + s[AFTER]
    x[MEANS + now] = s[REFERENCE] if targeted else s[COMMAND]
    x[0] = (now + 1) % LENGTH
    new, old = (now - whole) % LENGTH, (now - whole - 1) % LENGTH
    last, middle, first = x[ENDS + new], x[ENDS + old], x[ENDS + (old - 1) % LENGTH]
    if first == middle == last and not targeted:
        s[COMMAND] = s[HELD] = middle
        put_beside(s, middle, middle)
        return
    late = max(_until(first, middle, x[MEANS + old]) - (1.0 - part), 0.0)  # of the step: first still acts
    early = max(1.0 - part - _until(middle, last, x[MEANS + new]), 0.0)  # last acts already
    mean = late * first + (1.0 - late - early) * middle + early * last
    if targeted:
        s[REFERENCE] = s[HELD] = mean
    else:
        s[COMMAND] = s[HELD] = mean
        put_beside(s, first if late > 0.0 else middle, last if early > 0.0 else middle)


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
    states=2 + 2 * LENGTH,
    tags=("delay",),
    response=lambda p, s: np.exp(-p[0] * s),
    part="command",
    about="the command takes effect later than its stamp says",
    inspect="the bus period and the driver's queue, a controller that commands a cycle late, the "
    "latency timer of a USB adapter",
)
