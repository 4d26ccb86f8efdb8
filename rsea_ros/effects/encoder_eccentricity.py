"""Encoder disc or magnet that sits off its axis: an angle error that repeats with the rotor.

    position = q + amplitude · sin(cycles_per_revolution · θ_rotor + phase)

θ_rotor is the gear's ratio times q. The velocity is that of the same encoder. Source: Lu, Trumper,
Self-calibration of on-axis rotary encoders, CIRP Annals 56, 2007 (first harmonic: eccentricity).
"""

import math
from collections.abc import Sequence

from rsea_ros.effects.effect import PHASE, Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import Guess, ResidualView
from rsea_ros.effects.signal_table import OUTPUT_ANGLE, POSITION, TURNS, VELOCITY, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the error to the angle, and its rate to the speed."""
    wave = p[1] * s[TURNS]
    at = wave * s[OUTPUT_ANGLE] + p[2]
    s[POSITION] += p[0] * math.sin(at)
    s[VELOCITY] *= 1.0 + p[0] * wave * math.cos(at)


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin at the part of the angle's error that repeats with the rotor."""
    return [{**defaults[0], **repeating} for repeating in view.repeating_angle()]


EFFECT = Effect(
    name="encoder_eccentricity",
    port=Port.SENSOR,
    parameters=(
        Parameter(
            "amplitude", "rad", null=0.0, low=0.0, high=0.05, typical=1e-4, is_fixed=True,
            reason="it does not depend on the size of the machine; an encoder with 3 degrees is broken",
        ),
        Parameter(
            "cycles_per_revolution", "1", null=1.0, low=0.001, high=60.0, typical=1.0, starts=(2.0,),
            logarithmic=True, reason="from a slow gear stage to the poles of a magnet ring",
        ),
        PHASE,
    ),
    claims=Claims("velocity", "neither", amplitude_exponent=None),
    function=apply,
    guesses=guesses,
    about="angle error of the encoder that repeats with the rotor's angle",
    inspect="the centre of the encoder's magnet or disc on the shaft, its distance, the encoder's "
    "calibration",
)  # fmt: skip
