"""Torque constant other than believed: the motor makes more or less torque than its current says.

    T_m = gain * T_command

The measured current is turned into torque with the same wrong constant, so it does not show this.
Source: facts.md section 3 (6.826 N m/A by the maker's framework, 4.81 N m/A by its data sheet).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Scale the motor torque, after the current was measured."""
    s[COMMAND] *= p[0]


EFFECT = Effect(
    name="torque_constant_error",
    port=Port.MOTOR,
    parameters=(Parameter("gain", "1", null=1.0, low=0.2, high=3.0, typical=0.9, logarithmic=True),),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, confusable_with=("ft_gain_error",)),
    function=apply,
    about="the motor makes more or less torque than its current says",
    equation="T_motor = gain · T_command",
)
