"""Friction that grows with the load which the gear train carries.

    T = -coefficient · |T_s| · sign(ω), smooth below creep_velocity

T_s is the torque in the spring, or of a rigid joint its weight and what it stands against, ω the speed of the
gear output against the housing; the sign is smoothed below creep_velocity (presliding), see _friction.py.
Source: the motor's data sheet (no-load drag is a fraction of the paper's b_m).
"""

from rsea_ros.effects._friction import PRESLIDING, mean_friction
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, LOAD, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the friction torque from the torque on the gear output."""
    x[0] = mean_friction(s, p[0] * abs(s[LOAD]), x[0], p[1])
    s[GEAR_TORQUE] -= x[0]


EFFECT = Effect(
    name="load_dependent_friction",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "coefficient", "1", null=0.0, low=0.0, high=1.0, typical=0.15,
            reason="at 1 the gear locks itself",
        ),
        PRESLIDING,
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, passive=True),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY, LOAD),
    tags=("friction",),
    about="friction that grows with the torque in the spring",
    inspect="lubrication of the gear under load, alignment of its shafts, bearings with radial load",
)
