"""Dead zone of the drive: a command that is too small makes no torque.

    T_motor = sign(u) · (|u| - (1 - jump) · width) for |u| > width, else 0

jump 0: the torque begins at zero (a dead zone); jump 1: it begins with all that is commanded (a dead band,
as firmware has it). A jump is a ramp over 1/1000 of the width. Source: Tao, Kokotovic, Adaptive Control
of Systems with Actuator and Sensor Nonlinearities, 1996, section 2.1.
"""

import math
from collections.abc import Sequence

from rsea_ros.compiler import njit
from rsea_ros.effects._held import both_held, put_both
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.guess import Guess, ResidualView
from rsea_ros.effects.signal_table import CURRENT, CURRENT_BEFORE, Port

RAMP = 0.001
"""Of the width. A fit needs a slope where samples cross the edge."""


@njit(inline="always")
def _left_of(command, p):  # type: ignore[no-untyped-def]
    """Return the torque that a command makes, N m."""
    beyond = abs(command) - p[0]
    begun = p[1] * p[0] * min(max(beyond / (RAMP * p[0]) + 0.5, 0.0), 1.0)
    return math.copysign(max(beyond, 0.0) + begun, command)


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Take the zone out of the command, and out of the current that shows it."""
    if p[0] == 0.0:
        return
    before, after = both_held(s)
    put_both(s, _left_of(before, p), _left_of(after, p))
    s[CURRENT_BEFORE], s[CURRENT] = _left_of(s[CURRENT_BEFORE], p), _left_of(s[CURRENT], p)


_SHOWN = 0.3
"""Of a command: where the measured torque shows less, the command has not come through."""


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin at the largest command that the measured torque does not show, as a dead zone and a dead band."""
    unanswered = view.largest_unanswered_command(_SHOWN)
    if not unanswered:
        return list(defaults)
    width = (1.0 + RAMP) * unanswered
    return [{**defaults[0], "width": width, "jump": jump} for jump in (0.0, 1.0)]


EFFECT = Effect(
    name="dead_zone",
    port=Port.COMMAND,
    order=5,
    parameters=(
        Parameter(
            "width", "N m", null=0.0, low=0.0, high=50.0, typical=2.0, jumps=True,
            reason="commands below it make no torque: above the largest one, nothing would move",
        ),
        Parameter(
            "jump", "1", null=0.0, low=0.0, high=1.0, typical=0.0, starts=(1.0,), optional=True,
            reason="a share",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=0.0),
    function=apply,
    guesses=guesses,
    about="commands that are too small make no torque",
    inspect="the smallest current that the drive makes, its dead time, a threshold in firmware or in "
    "the bridge",
)
