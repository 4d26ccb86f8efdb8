"""Current loop of second order, which overshoots.

    time_constant² · T̈ + 2ζ · time_constant · Ṫ + T = T_command, overshoot = exp(-πζ / √(1 - ζ²))

overshoot is that of the step response, relative. The torque of a step is the exact mean of T_m over it for a
command that is held. Source: Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, 2010,
section 3.4.
"""

import math
from collections.abc import Sequence
from typing import Any

from rsea_ros.compiler import njit
from rsea_ros.effects._held import both_held, put_lagged, until_change
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import STEP, Port


@njit(inline="always")
def _later(at, rate, command, time, p):  # type: ignore[no-untyped-def]
    """Return the filtered command and its rate some time (s) later."""
    log = math.log(p[1])
    zeta = -log / math.sqrt(math.pi * math.pi + log * log)
    decay, turn, behind = zeta / p[0], math.sqrt(1.0 - zeta * zeta) / p[0], at - command
    e, c, n = math.exp(-decay * time), math.cos(turn * time), math.sin(turn * time) / turn
    after = command + e * (behind * (c + decay * n) + rate * n)
    return after, e * (rate * (c - decay * n) - behind * n / (p[0] * p[0]))


@njit(inline="always")
def _kept(at, rate, x, p, h):  # type: ignore[no-untyped-def]
    """Return what the filter has kept back since the state x, N m steps: by its equation."""
    log = math.log(p[1])
    zeta = -log / math.sqrt(math.pi * math.pi + log * log)
    return (p[0] * p[0] * (rate - x[1]) + 2.0 * zeta * p[0] * (at - x[0])) / h


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the command by the mean of the filtered one; x: that at the end of the step, and its rate."""
    if p[0] == 0.0:
        return
    h, (before, after), share = s[STEP], both_held(s), until_change(s)
    changed, rate = _later(x[0], x[1], before, share * h, p)
    end, rate_end = _later(changed, rate, after, (1.0 - share) * h, p)
    put_lagged(s, changed, end, _kept(end, rate_end, x, p, h), _kept(changed, rate, x, p, h))
    x[0], x[1] = end, rate_end


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
            logarithmic=True, reason="natural frequencies of 3 Hz to 1.6 kHz, as for the lag",
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
    tags=("lag",),
    response=response,
    about="second-order lag of the motor's current, with overshoot",
    inspect="gains of the drive's current loop against this motor's resistance and inductance",
)  # fmt: skip
