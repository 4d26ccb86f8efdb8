"""Gear train that gives between the rotor and the spring chassis.

    T = stiffness * (q_gear - q_chassis)

The chassis then moves on its own, with its own inertia. Source: Spong, Modeling and control of elastic joint
robots, J. Dyn. Syst. Meas. Control 109, 1987.
"""

import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.effects.effect import Claims, Effect, Parameter, RigLike
from rsea_ros.effects.guess import beside_softer_rotor
from rsea_ros.effects.signal_table import Port


def change(rig: RigLike, parameters: Mapping[str, float]) -> Any:
    """Return the rig with a gear of that stiffness."""
    return rig.with_values({"gear.stiffness": parameters["stiffness"]})


EFFECT = Effect(
    name="gear_compliance",
    port=Port.STRUCTURE,
    parameters=(
        Parameter(
            "stiffness", "N m/rad", null=math.inf, low=500.0, high=1e7, typical=1e4, starts=(3e3, 5e4),
            logarithmic=True,
            reason="a third of the spring's to thousands of times it, where it does not show",
        ),
    ),
    claims=Claims(
        "velocity",
        "odd",
        amplitude_exponent=1.0,
        passive=True,
        confusable_with=("command_delay", "current_loop_lag"),
    ),
    structure=change,
    guesses=beside_softer_rotor,
    about="gear train that gives between rotor and spring",
    equation="T = stiffness · (q_gear - q_chassis)",
)
