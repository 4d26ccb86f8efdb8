"""Torque ripple of the motor: cogging, or a harmonic of the rotor.

    T = amplitude · sin(cycles_per_revolution · θ_rotor + phase)

θ_rotor is the angle of the rotor against the housing, the gear's ratio times that of the output. The torque
of a step is the mean over it, so ripple faster than the step averages out instead of aliasing. Source: Jahns,
Soong, Pulsating torque minimization techniques for PM AC motor drives, IEEE Trans. Ind. Electron. 43, 1996.
"""

import math
from collections.abc import Sequence

from rsea_ros.compiler import njit
from rsea_ros.effects.effect import PHASE, Claims, Effect, OfRotorAngle, Parameter, compiled
from rsea_ros.effects.guess import Guess, ResidualView
from rsea_ros.effects.signal_table import GEAR_TORQUE, ROTOR_ANGLE, Port

LAST, STARTED = range(2)


@njit(cache=True, inline="always")
def mean_ripple(p, middle, way):  # type: ignore[no-untyped-def]
    """Return the mean torque over a travel of the rotor around an angle: the ripple times a sinc, N m."""
    half = 0.5 * p[1] * way
    share = math.sin(half) / half if half != 0.0 else 1.0
    return p[0] * share * math.sin(p[1] * middle + p[2])


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the mean ripple over the angle that the step covers."""
    angle = s[ROTOR_ANGLE]
    way = angle - x[LAST] if x[STARTED] == 1.0 else 0.0
    x[LAST], x[STARTED] = angle, 1.0
    s[GEAR_TORQUE] += mean_ripple(p, angle, way)


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin at the part of the missing torque that repeats with the rotor; without it there is no ripple."""
    return [{**defaults[0], **repeating} for repeating in view.repeating_torque()]


EFFECT = Effect(
    name="torque_ripple",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "amplitude", "N m", null=0.0, low=0.0, high=50.0, typical=1.0,
            reason="above the largest torque the rotor would stay in a detent",
        ),
        Parameter(
            "cycles_per_revolution", "1", null=4.0, low=0.2, high=60.0, typical=4.0, starts=(1.0, 2.0, 6.0,
            8.0, 12.0), logarithmic=True,
            reason="from a slow gear stage to the cogging of many poles",
        ),
        PHASE,
    ),
    claims=Claims("position", "neither", amplitude_exponent=None),
    function=apply,
    states=2,
    reads=(ROTOR_ANGLE,),
    guesses=guesses,
    compensation=OfRotorAngle(
        lambda p, start, end: float(mean_ripple.py_func(p, 0.5 * (start + end), end - start))
    ),
    about="torque that repeats with the rotor's angle",
    inspect="cogging (turn it by hand without current), the encoder's commutation offset, the gear's "
    "wave generator",
)
