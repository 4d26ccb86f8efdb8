"""Coulomb friction of the gear train: a torque of fixed size against the motion.

    T = -torque · sign(ω), smooth below creep_velocity

ω is the speed of the gear output against the housing; the sign is smoothed below creep_velocity (presliding),
see _friction.py. Source: Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2.
"""

from rsea_ros.compiler import njit
from rsea_ros.effects._friction import PRESLIDING, against, friction_torque, mean_friction
from rsea_ros.effects.effect import Claims, Effect, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, Port


@njit(cache=True, inline="always")
def level(p, w):  # type: ignore[no-untyped-def]
    """Return the friction torque at a speed, N m."""
    return p[0]


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the friction torque from the torque on the gear output."""
    x[0] = mean_friction(s, level(p, s[GEAR_VELOCITY]), x[0], p[1])
    s[GEAR_TORQUE] -= x[0]


EFFECT = Effect(
    name="coulomb_friction",
    port=Port.GEAR,
    parameters=(
        friction_torque("torque", 2.0),
        PRESLIDING,
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=0.0, passive=True,
        confusable_with=("stribeck_friction", "spring_hysteresis"),
    ),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    tags=("friction",),
    compensation=against(level, creep=1),
    about="friction torque of fixed size against the motion",
    inspect="bearing preload, seals, a gear without grease or too tight a mesh, cables that rub",
)
