"""Lag of the F/T sensor's own filter, first order.

    time_constant · Ṫ_ft + T_ft = T

integrated exactly for a torque that goes straight from step to step. Source: Bentley, Principles of
Measurement Systems, 2005, section 4.1 (element of first order).
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import FT, STEP, Port

OUT, LAST, STARTED = range(3)


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the sensor's torque by the lagged one."""
    if p[0] == 0.0:
        return
    torque = s[FT]
    if x[STARTED] == 0.0:
        x[OUT], x[LAST], x[STARTED] = torque, torque, 1.0
    behind = (torque - x[LAST]) * p[0] / s[STEP]
    x[OUT] = torque - behind + (x[OUT] - x[LAST] + behind) * math.exp(-s[STEP] / p[0])
    x[LAST] = torque
    s[FT] = x[OUT]


EFFECT = Effect(
    name="ft_sensor_lag",
    port=Port.SENSOR,
    order=10,
    parameters=(
        Parameter(
            "time_constant", "s", null=0.0, low=0.0, high=0.1, typical=3e-3, starts=(1e-3, 0.01),
            reason="filters of 1.6 Hz and more; manufacturers offer about 5 to 800 Hz",
        ),
    ),
    claims=Claims("ft", "odd", amplitude_exponent=1.0),
    function=apply,
    states=3,
    response=lambda p, s: 1.0 / (p[0] * s + 1.0),
    about="first-order lag of the F/T sensor",
    inspect="the filter in the sensor's settings (Net F/T: the low-pass of its web page), averages "
    "in the logger",
)
