"""Encoder whose readings are older than their stamps say.

    position(t) = q(t - delay)

The velocity is that of the same encoder. A known delay belongs into the rig, as `sensors.position.delay`.
Source: Astrom, Wittenmark, Computer-Controlled Systems, 1997, ch. 2 (systems with a time delay).
"""

from rsea_ros.effects._time import AGE, RING, older
from rsea_ros.effects.effect import Claims, Effect, compiled
from rsea_ros.effects.signal_table import POSITION, STEP, VELOCITY, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Replace the encoder's angle and speed by older ones."""
    if p[0] != 0.0:
        s[POSITION] = older(x, 0, s[POSITION], p[0] / s[STEP])
        s[VELOCITY] = older(x, RING, s[VELOCITY], p[0] / s[STEP])


EFFECT = Effect(
    name="encoder_delay",
    port=Port.SENSOR,
    order=15,
    parameters=(AGE,),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, confusable_with=("command_delay",)),
    function=apply,
    states=2 * RING,
    tags=("late",),
    about="the encoder's readings are older than their stamps say",
    inspect="stamps given at arrival, the drive's filter of its speed, the latency timer of a USB adapter",
)
