"""Spring that is stiffer one way than the other.

    T_s = K_s · d · (1 + quadratic · d)

On its softer side it keeps its largest torque beyond d = -1 / (2 quadratic), where the parabola would turn
back. A diagnosis does not try it unasked: springs are made symmetric, and beside friction that differs
with direction and play it takes the place of both. Source: Wigren, Schoukens, Three free data sets for
development and benchmarking in nonlinear system identification, ECC 2013 (the silverbox's spring is
asymmetric).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import DEFLECTION, K_S, SPRING_TORQUE, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the spring's torque beyond the linear one."""
    d, top = s[DEFLECTION], s[DEFLECTION]
    if p[0] > 0.0:
        top = max(d, -0.5 / p[0])
    if p[0] < 0.0:
        top = min(d, -0.5 / p[0])
    s[SPRING_TORQUE] += s[K_S] * (p[0] * top * top + (top - d))


EFFECT = Effect(
    name="lopsided_spring",
    port=Port.SPRING,
    parameters=(
        Parameter(
            "quadratic", "1/rad", null=0.0, low=-50.0, high=50.0, typical=3.0,
            reason="at the deflection of the largest torque, stiffness doubles or vanishes",
        ),
    ),
    claims=Claims("position", "even", amplitude_exponent=2.0),
    function=apply,
    is_searched=False,
    reads=(DEFLECTION,),
    about="spring that is stiffer one way than the other",
    inspect="springs of a pair that differ or are preloaded unequally, a spring that sits askew",
)
