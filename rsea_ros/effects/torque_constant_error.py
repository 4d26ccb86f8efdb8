"""Wrong torque constant: the motor makes more or less torque than its current indicates.

    T_motor = gain · T_command

The measured current is turned into torque with the same wrong constant, so it does not show this. For one
motor the maker's framework states 6.826 N·m/A and its data sheet 4.81 N·m/A. Source: Hughes, Drury, Electric
Motors and Drives, 2013, ch. 3 (torque and current).
"""

from collections.abc import Sequence

from rsea_ros.effects._held import scale
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import Guess, ResidualView
from rsea_ros.effects.signal_table import Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Scale the motor torque, after the current was measured."""
    scale(s, p[0])


_LOW, _HIGH = 0.2, 3.0
"""Bounds of the gain: no torque constant is further from its data sheet."""


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin at the torque constant, relative to the stated one, that the F/T torque shows.

    The motion is the same when every torque against the motor is larger by the same factor.
    """
    gain = view.gain("ft")
    if gain is None:
        return list(defaults)
    gain = min(max(gain, _LOW), _HIGH)
    return [{**defaults[0], "gain": gain, **{n: gain * view.value(n) for n in view.free}}]


EFFECT = Effect(
    name="torque_constant_error",
    port=Port.MOTOR,
    parameters=(
        Parameter(
            "gain", "1", null=1.0, low=_LOW, high=_HIGH, typical=0.9, logarithmic=True,
            reason="no torque constant is further from its data sheet",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, confusable_with=("ft_gain_error",)),
    function=apply,
    guesses=guesses,
    response=lambda p, s: p[0] + 0.0 * s,
    about="the motor makes more or less torque than its current says",
    inspect="the torque constant in the drive's settings, gear ratio, current scale; hang a known "
    "weight on a lever",
)
