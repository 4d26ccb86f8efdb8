"""Gear train that gives between the rotor and the spring chassis.

    T = stiffness · (q_gear - q_chassis)

The chassis then moves on its own, with its own inertia. A rig that states none counts it to the rotor: a part
of the rotor's goes over to it then. Source: Spong, Modeling and control of elastic joint robots, J. Dyn.
Syst. Meas. Control 109, 1987.
"""

import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.effects.effect import Claims, Effect, Parameter
from rsea_ros.effects.equation import equation_of
from rsea_ros.effects.guess import beside_softer_rotor
from rsea_ros.effects.signal_table import Port

_PART = 0.05
"""Of the rotor's reflected inertia: a chassis of which nothing is known. The paper's has a 240th, a large one
a tenth; it only has to be light beside the rotor."""


def change(rig: Any, parameters: Mapping[str, float]) -> Any:
    """Return the rig with a gear of that stiffness."""
    rotor, chassis = rig["rotor.reflected_inertia"], rig["chassis.inertia"]
    moved = 0.0 if chassis > 0.0 or rig.rigid_spring else _PART * rotor
    values = {"rotor.reflected_inertia": rotor - moved, "chassis.inertia": chassis + moved}
    return rig.with_values({"gear.stiffness": parameters["stiffness"], **values})


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
    equation=equation_of(__doc__),
)
