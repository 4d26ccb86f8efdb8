"""Hysteresis of the spring: torque that depends on the way the deflection came.

    T = torque · z, dz/dd = (1 - (β · sign(z · ḋ) + gamma) · |z|) / angle, β = 1 - gamma

Bouc-Wen with n = 1, scaled so that `torque` is where z ends; gamma = 0 is Dahl's model, at 1/2 unloading is
straight. Over a way in one direction z is an exponential of the way while it loads, with the rate β + gamma =
1, and another while it unloads, with β - gamma: both exact, and so is where z passes zero. A spring whose
loading bends less than its unloading, gamma < -1/2, need not end at all: there β + gamma = 1 - (gamma +
1/2)^2, which hardens below -3/2. Source: Dahl, AIAA J. 14, 1976; Wen, J. Eng. Mech. 102, 1976; Ismail,
Ikhouane, Rodellar, Arch. Comput. Methods Eng. 16, 2009, eq. (2).
"""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects._friction import friction_torque
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import COMMIT, DEFLECTION, DEFLECTION_SPAN, SPRING_TORQUE, Port

Z, LAST, STARTED = range(3)
_SMALL = 0.01
"""A way, times its rate, over which a series to the fourth power is exact to 1e-10."""
_LARGEST = 20.0
"""Of z: what hardens further is no hysteresis."""


@njit(cache=True, inline="always")
def reach(a, u):  # type: ignore[no-untyped-def]
    """Return (1 - exp(-a u)) / a, the gain of z from 0 over a path u, and its integral over the path."""
    x = a * u
    if abs(x) < _SMALL:
        series = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0))
        return u * series, 0.5 * u * u * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0)))
    gain = -math.expm1(-max(x, -30.0)) / a
    return gain, (u - gain) / a


@njit(cache=True, inline="always")
def along(z, u, gamma):  # type: ignore[no-untyped-def]
    """Return z at the end of a forward way of u angles, and its integral over the way."""
    area, beyond = 0.0, min(gamma + 0.5, 0.0)
    a = 1.0 - beyond * beyond
    if z < 0.0:
        b, whole = a - 2.0 * gamma, u
        if 1.0 - b * z > 0.0:
            whole = math.log1p(-b * z) / b if abs(b) > 1e-9 else -z
        way = min(u, whole)
        gain, rise = reach(b, way)
        area = z * way + (1.0 - b * z) * rise
        z = z + (1.0 - b * z) * gain if u < whole else 0.0
        u -= way
    gain, rise = reach(a, u)
    rest = 1.0 - a * z
    return min(max(z + rest * gain, -_LARGEST), _LARGEST), area + z * u + rest * rise


@njit(cache=True, inline="always")
def way_of(s, x):  # type: ignore[no-untyped-def]
    """Return how far the deflection has gone in the step; from where it was found at first, no way."""
    if s[COMMIT] != 1.0:
        return s[DEFLECTION_SPAN]
    return s[DEFLECTION] - x[LAST] if x[STARTED] != 0.0 else 0.0


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the mean torque of the step, or, when it is done, the torque at its end."""
    if p[0] == 0.0:
        return
    way = way_of(s, x)
    u, side = abs(way) / p[1], math.copysign(1.0, way)
    end, area = along(side * x[Z], u, p[2])
    if s[COMMIT] == 1.0:
        x[Z], x[LAST], x[STARTED] = side * end, s[DEFLECTION], 1.0
        s[SPRING_TORQUE] += p[0] * x[Z]
    else:
        mean = area / u if u > 0.0 else side * x[Z]
        s[SPRING_TORQUE] += p[0] * side * min(max(mean, -_LARGEST), _LARGEST)


EFFECT = Effect(
    name="spring_hysteresis",
    port=Port.SPRING,
    parameters=(
        friction_torque("torque", 1.0),
        Parameter(
            "angle", "rad", null=2e-3, low=1e-4, high=0.05, typical=2e-3, logarithmic=True,
            reason="from 1/200 of the deflection at the largest torque to more than it",
        ),
        Parameter(
            "gamma", "1", null=0.0, low=-3.0, high=0.95, typical=0.0, optional=True,
            reason="Dahl's 0, Bouc's 1/2, and springs that harden (Ismail), up to where z never ends",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=None, passive=True),
    function=apply,
    states=3,
    reads=(DEFLECTION,),
    about="spring torque that depends on the way the deflection came",
    inspect="friction in the spring's seats and guides, coils that rub, rubber parts, bolted leaf packages",
)
