"""Friction that differs between the two directions of motion.

    T = -offset - ½ viscous_difference · |ω|

ω is the speed of the gear output against the housing. offset (N·m) is the one-sided part: the torque that the
drive needs more forward than backward. viscous_difference (N·m·s/rad) is how much the viscous coefficient
forward exceeds the one backward; their mean is b_m, and it counts up to 2 b_m, where one of them is zero.
Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, 2019 (offset).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import B_M, GEAR_TORQUE, GEAR_VELOCITY, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the one-sided torque from the torque on the gear output."""
    difference = min(max(p[1], -2.0 * s[B_M]), 2.0 * s[B_M])
    s[GEAR_TORQUE] -= p[0] + 0.5 * difference * abs(s[GEAR_VELOCITY])


EFFECT = Effect(
    name="asymmetric_friction",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "offset", "N m", null=0.0, low=-50.0, high=50.0, typical=0.5,
            reason="friction above the largest torque would hold the machine still",
        ),
        Parameter(
            "viscous_difference", "N m s/rad", null=0.0, low=-100.0, high=100.0, typical=5.0,
            reason="four times the paper's 23 N·m·s/rad; the law limits it to 2 b_m",
        ),
    ),
    claims=Claims("position", "even", amplitude_exponent=None),
    function=apply,
    reads=(GEAR_VELOCITY,),
    tags=("friction",),
    about="friction that differs between forward and backward",
    inspect="seals and bearings that rub one way, a worm or a preloaded gear, a weight or a cable "
    "that pulls to one side",
)
