"""Mains that the F/T sensor's cable picks up.

    T_ft = T + amplitude · sin(2π · frequency · t + phase)

Source: Ott, Electromagnetic Compatibility Engineering, 2009, ch. 2 (cabling).
"""

import math
from dataclasses import replace

from rsea_ros.effects.effect import PHASE, Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import at_lines
from rsea_ros.effects.signal_table import FT, TIME, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the hum to the sensor's torque."""
    s[FT] += p[0] * math.sin(2.0 * math.pi * p[1] * s[TIME] + p[2])


EFFECT = Effect(
    name="mains_interference",
    port=Port.SENSOR,
    order=40,
    parameters=(
        Parameter(
            "amplitude", "N m", null=0.0, low=0.0, high=60.0, typical=0.3,
            reason="twice the largest torque, as the largest reading contains the hum",
        ),
        Parameter(
            "frequency", "Hz", null=50.0, low=45.0, high=65.0, typical=50.0, starts=(60.0,), is_fixed=True,
            reason="50 or 60 Hz on every machine; a grid keeps it to 1 %",
        ),
        replace(PHASE, typical=0.0, starts=(-1.6, 1.6, 3.1), optional=True, per_record=True),
    ),
    claims=Claims("ft", "even", amplitude_exponent=0.0),
    function=apply,
    guesses=at_lines("ft", sine=("amplitude", "phase")),
    about="mains hum in the F/T sensor",
    inspect="the sensor cable's shield and its ground, supplies and motor cables beside it",
)
