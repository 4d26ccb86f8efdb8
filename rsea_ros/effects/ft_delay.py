"""F/T sensor whose reading is older than its stamp says.

    T_ft(t) = T(t - delay)

A known delay belongs into the rig, as `sensors.ft.delay`. Source: Astrom, Wittenmark, Computer-Controlled
Systems, 1997, ch. 2 (systems with a time delay).
"""

import numpy as np

from rsea_ros.effects._time import AGE, RING, older
from rsea_ros.effects.effect import Claims, Effect, compiled
from rsea_ros.effects.signal_table import FT, STEP, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the sensor's torque by an older one."""
    if p[0] != 0.0:
        s[FT] = older(x, 0, s[FT], p[0] / s[STEP])


EFFECT = Effect(
    name="ft_delay",
    port=Port.SENSOR,
    order=15,
    parameters=(AGE,),
    claims=Claims("ft", "odd", amplitude_exponent=1.0, confusable_with=("ft_sensor_lag",)),
    function=apply,
    states=RING,
    response=lambda p, s: np.exp(-p[0] * s),
    tags=("late",),
    about="the F/T reading is older than its stamp says",
    inspect="stamps given at arrival, the sensor's network, the latency timer of a USB adapter",
)
