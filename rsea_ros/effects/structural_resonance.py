"""Resonance of the structure that carries the F/T sensor: a mode that the spring's torque shakes.

    T_ft = T · (1 - participation · (s² + beside · d s) / (s² + d s + Ω²)), d = 2 damping_ratio Ω,
    Ω = 2π frequency

that is ÿ + d · ẏ + Ω² · y = T and T_ft = T - participation · (ÿ + beside · d · ẏ), integrated exactly for a
torque that goes straight from step to step. With beside = 1 the sensor does not feel the mode's damper.
Source: Ewins, Modal Testing, 2000, section 2.4.
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import at_lines
from rsea_ros.effects.signal_table import FT, STEP, Port

Y, RATE, LAST, STARTED = range(4)


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the mode's inertia torque from the sensor's torque."""
    w, h, torque = 2.0 * math.pi * p[0], s[STEP], s[FT]
    if x[STARTED] == 0.0:
        x[Y], x[LAST], x[STARTED] = torque / (w * w), torque, 1.0
    decay, turn = p[1] * w, w * math.sqrt(1.0 - p[1] * p[1])
    slope = (torque - x[LAST]) / (h * w * w)
    lag = 2.0 * p[1] * slope / w
    u, v = x[Y] - x[LAST] / (w * w) + lag, x[RATE] - slope
    e, c, n = math.exp(-decay * h), math.cos(turn * h), math.sin(turn * h) / turn
    x[Y] = e * (u * (c + decay * n) + v * n) + torque / (w * w) - lag
    x[RATE] = e * (v * (c - decay * n) - u * w * w * n) + slope
    x[LAST] = torque
    s[FT] -= p[2] * (torque - 2.0 * decay * (1.0 - p[3]) * x[RATE] - w * w * x[Y])


EFFECT = Effect(
    name="structural_resonance",
    port=Port.SENSOR,
    parameters=(
        Parameter(
            "frequency", "Hz", null=33.0, low=2.0, high=140.0, typical=33.0, starts=(12.0, 20.0, 50.0, 80.0),
            logarithmic=True,
            reason="from the slowest structure to half the sampling rate",
        ),
        Parameter(
            "damping_ratio", "1", null=0.02, low=1e-3, high=0.5, typical=0.02, logarithmic=True,
            reason="0.001 to 0.1 for metal structures (Ewins); above, no mode is visible",
        ),
        Parameter(
            "participation", "1", null=0.0, low=-5.0, high=5.0, typical=0.3,
            reason="five times the spring's own torque at rest: the sensor would see little else",
        ),
        Parameter(
            "beside", "1", null=0.0, low=0.0, high=1.0, typical=0.0, optional=True,
            reason="a share of the damper",
        ),
    ),
    claims=Claims("ft", "odd", amplitude_exponent=1.0),
    function=apply,
    states=4,
    guesses=at_lines("ft"),
    tags=("mode",),
    part="support",
    about="a mode of the structure that the F/T sensor sees beside the spring",
    inspect="what the sensor carries: brackets, long screws, the arm beyond it; tap it and look for "
    "this frequency",
)
