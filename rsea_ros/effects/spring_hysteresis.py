"""Hysteresis of the spring: torque that depends on the way the deflection came.

    T = torque * z,   dz/dd = (1 - z sign(dd)) / angle

Bouc-Wen with n = 1 and beta = gamma = 1/2, which is Dahl's model: over a way in one direction z goes to
sign(dd) as exp(-|dd| / angle), exactly. Source: Dahl, AIAA J. 14, 1976; Wen, J. Eng. Mech. 102, 1976.
"""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMIT, DEFLECTION, DEFLECTION_SPAN, SPRING_TORQUE, Port

Z, LAST, STARTED = range(3)
_SMALL = 0.01
"""A way, in angles, over which a series to the fourth power is exact to 1e-10."""


@njit(inline="always")
def mean_fade(u):  # type: ignore[no-untyped-def]
    """Return the mean of exp(-x) over x from 0 to u."""
    if u < _SMALL:
        return 1.0 - u / 2.0 * (1.0 - u / 3.0 * (1.0 - u / 4.0))
    return -math.expm1(-u) / u


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the mean torque of the step, or, when it is done, the torque at its end."""
    if p[0] == 0.0:
        return
    way = s[DEFLECTION] - x[LAST] if s[COMMIT] == 1.0 else s[DEFLECTION_SPAN]
    if x[STARTED] == 0.0 and s[COMMIT] == 1.0:
        way = 0.0
    u, goal = abs(way) / p[1], math.copysign(1.0, way)
    mean = mean_fade(u)
    if s[COMMIT] == 1.0:
        x[Z] += (goal - x[Z]) * u * mean
        x[LAST], x[STARTED] = s[DEFLECTION], 1.0
        s[SPRING_TORQUE] += p[0] * x[Z]
    else:
        s[SPRING_TORQUE] += p[0] * (goal + (x[Z] - goal) * mean)


EFFECT = Effect(
    name="spring_hysteresis",
    port=Port.SPRING,
    parameters=(
        Parameter("torque", "N m", null=0.0, low=0.0, high=20.0, typical=1.0),
        Parameter("angle", "rad", null=2e-3, low=1e-4, high=0.05, typical=2e-3, logarithmic=True),
    ),
    claims=Claims(
        "velocity",
        "odd",
        amplitude_exponent=None,
        passive=True,
    ),
    function=apply,
    states=3,
    reads=(DEFLECTION,),
    about="spring torque that depends on the way the deflection came",
    equation="T = torque · z, dz/dd = (1 - z · sign(ḋ)) / angle",
)
