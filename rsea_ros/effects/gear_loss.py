"""Loss of a gear train in proportion to the motor's torque, unequal in driving and in being driven.

    T = -(mean · |T_m| · z + difference · T_m · z²), ż = (ω - |ω| · z) / angle

T_m is the motor's torque at the gear output, ω the speed of the gear output against the housing. z follows
the direction of motion over an angle (presliding) and ends at its sign: a gear that drives loses (mean +
difference) |T_m|, one that is driven back (mean - difference) |T_m|. It reads no load, so a rigid joint has
it too. With ω of the middle of a step z is an exponential of the travel, exactly; the means of z and z² over
the step act. Source: torque-proportional loss in dcmotor, MuJoCo issue 3528, 2026 (strain-wave and cycloidal
gears).
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, GEAR_TORQUE, GEAR_VELOCITY, STEP, Port
from rsea_ros.effects.spring_hysteresis import reach


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the mean loss over the step; x[0] is z at its end."""
    way = s[GEAR_VELOCITY] * s[STEP]
    path, side = abs(way) / p[2], math.copysign(1.0, way)
    behind = side - x[0]
    once = twice = 1.0
    if path > 0.0:
        once, twice = reach(1.0, path)[0] / path, reach(2.0, path)[0] / path
    z = side - behind * once
    squared = 1.0 - 2.0 * side * behind * once + behind * behind * twice
    s[GEAR_TORQUE] -= p[0] * abs(s[COMMAND]) * z + p[1] * s[COMMAND] * squared
    x[0] = side - behind * math.exp(-path)


EFFECT = Effect(
    name="gear_loss",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "mean", "1", null=0.0, low=0.0, high=0.9, typical=0.1,
            reason="at 1 the gear locks itself",
        ),
        Parameter(
            "difference", "1", null=0.0, low=-0.5, high=0.5, typical=0.0, optional=True,
            reason="a gear is driven back with more loss than it drives, or with less",
        ),
        Parameter(
            "angle", "rad", null=1e-3, low=1e-4, high=0.05, typical=1e-3, logarithmic=True, optional=True,
            ideal_at_low=True,
            reason="from a tenth of a milliradian, as good as none, to teeth and seals of a soft gear",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    tags=("friction",),
    about="loss of the gear in proportion to the motor's torque",
    inspect="efficiency of the gear driving and driven back: lubrication, preload, wear of the teeth",
)  # fmt: skip
