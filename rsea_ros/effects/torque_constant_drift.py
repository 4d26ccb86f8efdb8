"""Torque constant that changes during the record: magnets lose flux as they warm, 0.1 to 0.2 % a kelvin.

    T_motor = T_command · (1 + relative_change · s(t) / s(duration)), s(t) = 1 - exp(-t / time_constant),
    or t without one

The measured current does not show it. Source: Sebastian, Temperature effects on torque production and
efficiency of PM motors, IEEE Trans. Ind. Appl. 31, 1995.
"""

from rsea_ros.effects._held import scale
from rsea_ros.effects._time import SETTLING, progress
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import DURATION, STEP, TIME, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Scale the motor torque as in the middle of the step, after the current was measured."""
    scale(s, 1.0 + p[0] * progress(s[TIME] + 0.5 * s[STEP], s[DURATION], p[1]))


EFFECT = Effect(
    name="torque_constant_drift",
    port=Port.MOTOR,
    parameters=(
        Parameter(
            "relative_change", "1", null=0.0, low=-0.8, high=2.0, typical=-0.15,
            reason="magnets lose 0.2 % per kelvin, but a drive that derates may take all",
        ),
        SETTLING,
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0),
    function=apply,
    about="the motor's torque constant changes during the record",
    inspect="temperature of the motor: magnets lose 0.1 to 0.2 % a kelvin; compare cold with warm",
)
