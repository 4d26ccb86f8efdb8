"""Load-dependent friction that the motor's torque and the load's make unequally, as in gears that drive
better than they are driven.

    T = -(|motor_coefficient · T_m + load_coefficient · T_s| + quadratic · min(|T_m|, |T_s|)²) · sign(ω),
    smooth below creep_velocity

The quadratic part acts where motor and spring work against each other (T_m · T_s > 0). T_m is the motor's
torque, T_s that in the spring, or of a rigid joint its weight and what it stands against, ω the speed of the
gear output against the housing; the sign is smoothed below creep_velocity (presliding), see _friction.py.
Source: Duclusaud, Passault, Padois, Ly, Extended friction models for the physics simulation of servo
actuators, 2024, models M5 and M6 (their Stribeck factor apart).
"""

from rsea_ros.effects._friction import PRESLIDING, mean_friction
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMAND, GEAR_TORQUE, GEAR_VELOCITY, LOAD, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the friction torque from the torque on the gear output."""
    motor, load = s[COMMAND], s[LOAD]
    size = abs(p[0] * motor + p[1] * load)
    if motor * load > 0.0:
        less = min(abs(motor), abs(load))
        size += p[2] * less * less
    x[0] = mean_friction(s, size, x[0], p[3])
    s[GEAR_TORQUE] -= x[0]


EFFECT = Effect(
    name="directional_load_friction",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "motor_coefficient", "1", null=0.0, low=0.0, high=0.9, typical=0.15,
            reason="at 1 the gear locks itself",
        ),
        Parameter(
            "load_coefficient", "1", null=0.0, low=0.0, high=0.9, typical=0.05,
            reason="at 1 the gear locks itself",
        ),
        Parameter(
            "quadratic", "1/(N m)", null=0.0, low=0.0, high=0.1, typical=0.0, optional=True,
            reason="three times the largest torque, at that torque",
        ),
        PRESLIDING,
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=1.0, passive=True,
        confusable_with=("load_dependent_friction",),
    ),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY, LOAD),
    tags=("friction",),
    about="friction that grows unequally with the motor's torque and the load",
    inspect="efficiency of the gear driving and driven back: lubrication, wear of the teeth, worm or "
    "cycloid contact",
)
