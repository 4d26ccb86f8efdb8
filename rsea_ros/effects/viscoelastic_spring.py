"""Spring that creeps: a branch of spring and damper in series beside it.

    T = share · K_s · z,   ż = ḋ - z / time_constant

The standard linear solid: a step of deflection meets (1 + share) K_s at once and K_s in the end, so the loss
stands about 1 / (2 pi time_constant), where that of a damper grows with the frequency. A deflection that is
straight over a step gives z exactly, and its mean. Source: Lakes, Viscoelastic Materials, 2009, section 2.6;
rubber and polymer springs: share 0.03 to 0.5, ten milliseconds to seconds.
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMIT, DEFLECTION, K_S, SPRING_TORQUE, STEP, Port
from rsea_ros.effects.spring_hysteresis import LAST, STARTED, Z, way_of


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the mean torque of the step, or, when it is done, the torque at its end."""
    if p[0] == 0.0:
        return
    u = s[STEP] / p[1]
    steady, left = way_of(s, x) / u, -math.expm1(-u)
    if s[COMMIT] == 1.0:
        x[Z] += (steady - x[Z]) * left
        x[LAST], x[STARTED] = s[DEFLECTION], 1.0
        s[SPRING_TORQUE] += p[0] * s[K_S] * x[Z]
    else:
        s[SPRING_TORQUE] += p[0] * s[K_S] * (steady + (x[Z] - steady) * left / u)


EFFECT = Effect(
    name="viscoelastic_spring",
    port=Port.SPRING,
    parameters=(
        Parameter(
            "share", "1", null=0.0, low=0.0, high=2.0, typical=0.1,
            reason="of the spring's own stiffness; three times as stiff at once as in the end is no spring",
        ),
        Parameter(
            "time_constant", "s", null=0.1, low=3e-3, high=10.0, typical=0.1, starts=(0.02, 0.5),
            logarithmic=True, reason="faster it is the spring's damping, slower its stiffness",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0, passive=True),
    function=apply,
    states=3,
    reads=(DEFLECTION,),
    about="spring that creeps: stiffer at once than in the end",
    inspect="polymer or rubber in the torque path, glued joints, a coupling's insert; compare cold with warm",
)  # fmt: skip
