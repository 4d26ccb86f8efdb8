"""Payload that the rig does not know of: more or less weight on the output, on an arm.

    T = -torque · sin(q)

q is the absolute angle of the end that moves, torque the excess of m g l over the rig's. Its inertia is left
to the fit. Only where an end is free: on a bench with both ends clamped nothing turns far enough, and it
would imitate a motor constant. Source: Craig, Introduction to Robotics, 2005, section 6.
"""

from collections.abc import Mapping
from typing import Any

from rsea_ros.effects.effect import Claims, Effect, Parameter
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import ParameterError


def change(rig: Any, parameters: Mapping[str, float]) -> Any:
    """Return the rig with the additional gravity on its free end. Raises ParameterError without a free end.

    The spring's end, where both are free.
    """
    free = [end for end in ("spring_end", "housing_end") if end not in rig.clamped]
    if not free:
        raise ParameterError(f"effect gravity_error: rig {rig.name}: both ends clamped, expected a free one")
    name = f"{free[0]}.gravity"
    return rig.with_values({name: max(0.0, rig[name] + parameters["torque"])})


EFFECT = Effect(
    name="gravity_error",
    port=Port.STRUCTURE,
    parameters=(
        Parameter(
            "torque", "N m", null=0.0, low=-50.0, high=50.0, typical=2.0,
            reason="the machine could not hold more than its largest torque",
        ),
    ),
    claims=Claims("position", "odd", amplitude_exponent=None),
    structure=change,
    about="weight on the output that the rig does not know of",
    inspect="mass and lever of what hangs on the output, the mounting angle, a payload that the rig "
    "does not state",
)
