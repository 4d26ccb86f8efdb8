"""Current loop of second order, which overshoots.

    time_constant² · T̈ + 2ζ · time_constant · Ṫ + T = T_command, overshoot = exp(-πζ / √(1 - ζ²))

overshoot is that of the step response, relative. The torque of a step is the exact mean of T_m over it for a
command that is held. Source: Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, 2010,
section 3.4.
"""

import math
from collections.abc import Sequence
from typing import Any

from rsea_ros.effects._held import fade
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, CURRENT, STEP, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the command by the mean of the filtered one; x: that at the end of the step, and its rate."""
    if p[0] == 0.0:
        return
    command, h, log = s[COMMAND], s[STEP], math.log(p[1])
    zeta = -log / math.sqrt(math.pi * math.pi + log * log)
    decay, turn = zeta / p[0], math.sqrt(1.0 - zeta * zeta) / p[0]
    behind, rate = x[0] - command, x[1]
    e, c, n = math.exp(-decay * h), math.cos(turn * h), math.sin(turn * h) / turn
    after = e * (behind * (c + decay * n) + rate * n)
    rate_after = e * (rate * (c - decay * n) - behind * n / (p[0] * p[0]))
    moved = p[0] * p[0] * (rate_after - rate) + 2.0 * zeta * p[0] * (after - behind)
    s[COMMAND] = command - moved / h
    x[0], x[1] = command + after, rate_after
    s[CURRENT] = x[0]
    fade(s, p[0])


def response(p: Sequence[float], s: Any) -> Any:
    """Return current over command, shape (n,)."""
    log = math.log(p[1])
    zeta = -log / math.hypot(math.pi, log)
    return 1.0 / ((p[0] * s) ** 2 + 2.0 * zeta * p[0] * s + 1.0)


EFFECT = Effect(
    name="current_loop_overshoot",
    port=Port.COMMAND,
    order=20,
    parameters=(
        Parameter(
            "time_constant", "s", null=0.0, low=1e-4, high=0.05, typical=4e-3, starts=(1.5e-3, 0.01),
            logarithmic=True,
            reason="natural frequencies of 3 Hz to 1.6 kHz, as for the lag",
        ),
        Parameter(
            "overshoot", "1", null=0.3, low=0.01, high=0.9, typical=0.3, logarithmic=True,
            reason="below, the loop is a lag of first order; above, it rings without end",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=1.0, confusable_with=("command_delay", "current_loop_lag")
    ),
    function=apply,
    states=2,
    response=response,
    about="second-order lag of the motor's current, with overshoot",
)  # fmt: skip
