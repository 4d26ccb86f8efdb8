"""Encoder whose readings are older than their stamps say.

    position(t) = q(t - delay)

The velocity is that of the same encoder. A known delay belongs into the rig, as `sensors.position.delay`.
Source: Astrom, Wittenmark, Computer-Controlled Systems, 1997, ch. 2 (systems with a time delay).
"""

from rsea_ros.effects._late import RING, older
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
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
    parameters=(
        Parameter(
            "delay", "s", null=0.0, low=0.0, high=0.06, typical=5e-3, starts=(1e-3, 0.015, 0.03),
            is_fixed=True,
            reason="drives and serial adapters: one cycle at 1 kHz to three at 50 Hz",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, confusable_with=("command_delay",)),
    function=apply,
    states=2 * RING,
    tags=("late",),
    about="the encoder's readings are older than their stamps say",
    inspect="stamps given at arrival, the drive's filter of its speed, the latency timer of a USB adapter",
)
