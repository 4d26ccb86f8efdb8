"""Stribeck friction of the gear train: more friction near rest than at speed.

    T = -(coulomb_torque + stribeck_torque · exp(-(ω / stribeck_velocity)²)) · sign(ω),
    smooth below creep_velocity

ω is the speed of the gear output against the housing; the sign is smoothed below creep_velocity (presliding),
see _friction.py. Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30, 1994, eq. (3).
"""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects._friction import PRESLIDING, against, friction_torque, mean_friction
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, Port


@njit(cache=True, inline="always")
def level(p, w):  # type: ignore[no-untyped-def]
    """Return the friction torque at a speed, N m."""
    ratio = w / p[2]
    return p[0] + p[1] * math.exp(-ratio * ratio)


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the friction torque from the torque on the gear output."""
    x[0] = mean_friction(s, p[0], x[0], p[3], p[1], p[2])
    s[GEAR_TORQUE] -= x[0]


EFFECT = Effect(
    name="stribeck_friction",
    port=Port.GEAR,
    parameters=(
        friction_torque("coulomb_torque", 1.5),
        friction_torque("stribeck_torque", 2.0),
        Parameter(
            "stribeck_velocity", "rad/s", null=0.05, low=0.005, high=1.0, typical=0.05, starts=(0.015, 0.2),
            logarithmic=True, reason="from a hundredth of the largest speed to more than it",
        ),
        PRESLIDING,
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=None, passive=True,
        confusable_with=("coulomb_friction", "spring_hysteresis"),
    ),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    tags=("friction",),
    compensation=against(level, creep=3),
    about="friction that is larger near rest than at speed",
    inspect="grease (age, cold), seals, a joint that stood for long: let it run in and compare",
)
