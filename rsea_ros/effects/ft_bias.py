"""F/T sensor whose zero is off.

    T_ft = T + bias

Source: Bentley, Principles of Measurement Systems, 2005, section 2.1 (interfering input).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import FT, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the bias to the sensor's torque."""
    s[FT] += p[0]


EFFECT = Effect(
    name="ft_bias",
    port=Port.SENSOR,
    order=30,
    parameters=(
        Parameter(
            "bias", "N m", null=0.0, low=-60.0, high=60.0, typical=0.5,
            reason="twice the largest torque, as the largest reading contains the bias",
        ),
    ),
    claims=Claims("ft", "even", amplitude_exponent=0.0, confusable_with=("ft_drift",)),
    function=apply,
    about="zero of the F/T sensor that is off",
    inspect="tare the sensor at rest without load; weight of the tool, a cable that pulls, mounting "
    "screws that strain it",
)
