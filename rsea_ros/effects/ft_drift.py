"""F/T sensor whose zero walks away during the record, straight on or settling as the sensor warms up.

    T_ft = T + drift · s(t) / s(duration), s(t) = 1 - exp(-t / time_constant), or t without one

Source: Bentley, Principles of Measurement Systems, 2005, section 2.1 (interfering input: the temperature).
"""

from rsea_ros.effects._time import SETTLING, progress
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import DURATION, FT, TIME, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the drift so far to the sensor's torque."""
    s[FT] += p[0] * progress(s[TIME], s[DURATION], p[1])


EFFECT = Effect(
    name="ft_drift",
    port=Port.SENSOR,
    order=30,
    parameters=(
        Parameter(
            "drift", "N m", null=0.0, low=-60.0, high=60.0, typical=0.5,
            reason="twice the largest torque, as the largest reading contains the drift",
        ),
        SETTLING,
    ),
    claims=Claims("ft", "even", amplitude_exponent=0.0, confusable_with=("ft_bias",)),
    function=apply,
    about="zero of the F/T sensor that walks during the record",
    inspect="warm-up of the sensor (half an hour), heat of the motor that reaches it, an amplifier "
    "that drifts",
)
