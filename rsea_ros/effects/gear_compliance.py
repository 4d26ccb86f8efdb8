"""Gear train that gives between the rotor and the spring chassis.

    T = stiffness · (q_gear - q_chassis) + 2 · damping_ratio · √(stiffness · J_c) · (ω_gear - ω_chassis),
    J_c = chassis_share · J_m where the rig states no inertia of the chassis

The chassis then moves on its own, with its own inertia J_c (on a rigid spring with what hangs on it). A rig
that states none counts it to the rotor's J_m, from which it is taken then. Source: Spong, Modeling and
control of elastic joint robots, J. Dyn. Syst. Meas. Control 109, 1987; damping: Ewins, Modal Testing, 2000.
"""

import math
from collections.abc import Mapping
from typing import Any

from rsea_ros.effects.effect import Claims, Effect, Parameter
from rsea_ros.effects.guess import beside_softer_rotor
from rsea_ros.effects.signal_table import Port

_SHARE = "chassis_share"


def change(rig: Any, parameters: Mapping[str, float]) -> Any:
    """Return the rig with a gear of that stiffness and damping."""
    parameters = EFFECT.complete(parameters)
    stiffness = parameters["stiffness"]
    if math.isinf(stiffness):
        return rig
    rotor, chassis = rig["rotor.reflected_inertia"], rig["chassis.inertia"]
    moved = 0.0 if idle(rig) else parameters[_SHARE] * rotor
    is_on_load = rig.rigid_spring and rig.end_is_free("spring_end")
    beyond = chassis + moved + (rig["spring_end.inertia"] if is_on_load else 0.0)
    damping = 2.0 * parameters["damping_ratio"] * math.sqrt(stiffness * beyond)
    values = {
        "gear.stiffness": stiffness,
        "gear.damping": damping if damping > 1e-9 else 0.0,  # a fit came to 1e-14, which no rig states
        "rotor.reflected_inertia": rotor - moved,
        "chassis.inertia": chassis + moved,
    }
    return rig.with_values(values)


def idle(rig: Any) -> tuple[str, ...]:
    """Return the share of the rotor's inertia where nothing goes over to the chassis."""
    return (_SHARE,) if rig["chassis.inertia"] > 0.0 or rig.rigid_spring else ()


EFFECT = Effect(
    name="gear_compliance",
    port=Port.STRUCTURE,
    parameters=(
        Parameter(
            "stiffness", "N m/rad", null=math.inf, low=500.0, high=1e7, typical=1e4, starts=(3e3, 5e4),
            logarithmic=True,
            reason="from a third of the spring's to thousands of times it, where it has no visible effect",
        ),
        Parameter(
            "damping_ratio", "1", null=0.0, low=0.0, high=0.1, typical=0.0, optional=True, spread=0.02,
            reason="0.001 to 0.1 for metal structures (Ewins); 0.02 is usual, and one sigma about zero",
        ),
        Parameter(
            _SHARE, "1", null=0.02, low=1e-3, high=0.5, typical=0.02, logarithmic=True, optional=True,
            spread=1.6,
            reason="one sigma is a factor of 5 about 0.02: the paper's is a 240th, a large one a tenth",
        ),
    ),
    claims=Claims(
        "velocity", "odd", amplitude_exponent=1.0, passive=True,
        confusable_with=("command_delay", "current_loop_lag"),
    ),
    structure=change,
    guesses=beside_softer_rotor,
    about="gear train that gives between rotor and spring",
    inspect="teeth and flexspline of the gear, the coupling between motor and gear, a timing belt's tension",
    idle=idle,
)
