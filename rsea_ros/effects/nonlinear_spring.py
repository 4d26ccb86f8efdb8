"""Spring that hardens (cubic > 0) or softens (cubic < 0) as it deflects.

    T_s = K_s · d · (1 + cubic · d²)

A softening spring keeps its largest torque beyond d = 1 / sqrt(-3 cubic), where the cubic would turn back.
Source: Kovacic, Brennan, The Duffing Equation, 2011, ch. 1.
"""

import math

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import DEFLECTION, K_S, SPRING_TORQUE, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the spring's torque beyond the linear one."""
    d, top = s[DEFLECTION], s[DEFLECTION]
    if p[0] < 0.0:
        turn = math.sqrt(-1.0 / (3.0 * p[0]))
        top = min(max(d, -turn), turn)
    s[SPRING_TORQUE] += s[K_S] * (p[0] * top * top * top + (top - d))


EFFECT = Effect(
    name="nonlinear_spring",
    port=Port.SPRING,
    parameters=(
        Parameter(
            "cubic", "1/rad^2", null=0.0, low=-2000.0, high=20000.0, typical=500.0,
            reason="at the deflection of the largest torque, from four fifths softer to eight times stiffer",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=3.0, confusable_with=("hard_stop",)),
    function=apply,
    reads=(DEFLECTION,),
    about="spring that hardens or softens as it deflects",
    inspect="the spring's angle of work against its drawing, coils that touch, cams and their preload",
)
