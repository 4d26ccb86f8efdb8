"""F/T sensor whose calibration is off.

    T_ft = gain · T

Source: Bentley, Principles of Measurement Systems, 2005, section 2.1 (modifying input).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import FT, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Scale the sensor's torque."""
    s[FT] *= p[0]


EFFECT = Effect(
    name="ft_gain_error",
    port=Port.SENSOR,
    order=20,
    parameters=(
        Parameter(
            "gain", "1", null=1.0, low=0.2, high=3.0, typical=0.95,
            reason="a larger error means another sensor or unit, which the data checks find",
        ),
    ),
    claims=Claims("ft", "odd", amplitude_exponent=1.0, confusable_with=("torque_constant_error",)),
    function=apply,
    response=lambda p, s: p[0] + 0.0 * s,
    about="calibration of the F/T sensor that is off",
    inspect="the sensor's calibration sheet and its axes in the driver, the unit of its counts; hang "
    "a known weight on a lever",
)
