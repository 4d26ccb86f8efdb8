"""LuGre friction of the gear train: bristles that bend before they slip.

    T = -(bristle_stiffness · z + bristle_damping · ż), ż = ω - bristle_stiffness · |ω| · z / g(ω),
    g = coulomb_torque + stribeck_torque · exp(-(ω / stribeck_velocity)²)

ω is the speed of the gear output against the housing. With ω of the middle of a step z is an exponential of
the travel, exactly, and its mean over the step acts. Source: Canudas de Wit, Olsson, Astrom, Lischinsky,
IEEE Trans. Autom. Control 40, 1995, eqs. (1) to (4).
"""

import math

from rsea_ros.effects._friction import friction_torque
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, STEP, Port
from rsea_ros.effects.spring_hysteresis import reach


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the mean torque of the bristles over the step; x[0] is their bend at its end, rad."""
    w = s[GEAR_VELOCITY]
    ratio = w / p[3]
    level = p[0] + p[2] * math.exp(-ratio * ratio)
    way, rate = w * s[STEP], p[1] / max(level, 1e-9)
    gain, rise = reach(rate, abs(way))
    side = math.copysign(1.0, way)
    rest = side - rate * x[0]
    mean = x[0] + (rest * rise / abs(way) if way != 0.0 else 0.0)
    end = x[0] + rest * gain
    s[GEAR_TORQUE] -= p[1] * mean + p[4] * (end - x[0]) / s[STEP]
    x[0] = end


EFFECT = Effect(
    name="lugre_friction",
    port=Port.GEAR,
    parameters=(
        friction_torque("coulomb_torque", 2.0),
        Parameter(
            "bristle_stiffness", "N m/rad", null=0.0, low=50.0, high=1e5, typical=2500.0, starts=(500.0, 1e4),
            logarithmic=True,
            reason="from a thirtieth of the spring's to seventy times it; stiffer is Coulomb friction",
        ),
        friction_torque("stribeck_torque", 1.0),
        Parameter(
            "stribeck_velocity", "rad/s", null=0.03, low=0.003, high=1.0, typical=0.03, logarithmic=True,
            reason="from half a percent of the largest speed to more than it",
        ),
        Parameter(
            "bristle_damping", "N m s/rad", null=0.0, low=0.0, high=100.0, typical=5.0, optional=True,
            reason="four times the paper's viscous damping, 23 N·m·s/rad",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=None, passive=True,
        confusable_with=("coulomb_friction", "stribeck_friction", "spring_hysteresis"),
    ),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    tags=("friction",),
    about="friction of bristles that bend before they slip",
    inspect="seals and preloaded bearings near rest; repeat slow reversals of a few milliradians",
)  # fmt: skip
