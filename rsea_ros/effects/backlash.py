"""Backlash: play between the gear output and the spring chassis.

    T_s = K_s · y + b_s · ẏ, J · ÿ + b_s · ẏ + K_s · y = C, |d - y| ≤ gap / 2, J = (1 - on_gear) · J_sc

y is the chassis, which has its own inertia, d the gear output, both against the distal side. The flanks
only push: C >= 0 at the forward one. The impact is inelastic, see _chassis.py. With e = y - d the gear
feels J e'' + b_s e' + K_s e beside the torque of the nominal spring, the F/T sensor all but the first.
Where the play lies behind the chassis, that turns with the gear: on_gear = 1, and the spring's seat is light:
T_s = K_s · e + b_s · ė beyond the gap, with e the gear's angle there, as long as that pushes.
The error of a step is corrected in the next one, so an unforeseen impact at its end loses no momentum.
With the housing free, 4 mrad, 30 N·m of noise or chirp at 280 Hz, the torque is within 0.1 to 0.7 % RMS of
an event-driven model in 28 of 30 records (1 mrad: 0.2 %), but for samples within 0.1 ms of an impact, where
the damper's torque jumps: one of them makes it 3 to 4 %. Where flanks barely graze, exact solvers part too.
Source: Nordin, Gutman, Automatica 38, 2002, section 2 (exact model of a shaft with play), with inertia.
"""

from collections.abc import Sequence

from rsea_ros.effects import signal_table as st
from rsea_ros.effects._chassis import GearPath, SprungChassis, along, over_step, seat_torque
from rsea_ros.effects.effect import Claims, Effect, Gap, Parameter, compiled
from rsea_ros.effects.guess import STIFFNESS, Guess, ResidualView

Y, V, SIDE, D, W, GIVEN, OWED, STARTED = range(8)
FASTEST = 0.1
"""Smallest inertia of the chassis, in K_s h^2: a faster one the step cannot show."""


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the mean torque of the step or, when it is done, the torque at the sensor at its end."""
    half, h, k, b = 0.5 * p[0], s[st.STEP], s[st.K_S], s[st.B_S]
    if half == 0.0 or k == 0.0:
        return
    least = FASTEST * k * h * h
    j, seated = max(s[st.J_SC], least), p[1]
    d, w = s[st.DEFLECTION] + 0.5 * s[st.DEFLECTION_SPAN], s[st.DEFLECTION_RATE]
    if x[STARTED] == 0.0:
        x[D], x[W], x[STARTED] = s[st.DEFLECTION] - 0.5 * s[st.DEFLECTION_SPAN], w, 1.0
        x[Y] = min(max(0.0, x[D] - half), x[D] + half)
    if s[st.COMMIT] == 0.0:
        w = 2.0 * w - x[W]
    path, chassis = GearPath(x[D], x[W], d, w, h), SprungChassis(k, b, j)
    y, v, side, area = over_step(x[Y], x[V], x[SIDE], half, path, chassis)
    _, _, whole = along(path, h)
    seat, seat_at_end = seat_torque(half, path, chassis)
    nominal = (k * whole + b * (d - x[D])) / h
    spring = (1.0 - seated) * (k * area + b * (y - x[Y])) / h + seated * seat - nominal
    inertia = (1.0 - seated) * j * ((v - x[V]) - (w - x[W])) / h + x[OWED]
    if s[st.COMMIT] == 0.0:
        x[GIVEN] = spring + inertia
        s[st.SPRING_TORQUE] += spring + inertia
        s[st.DISTAL_TORQUE] -= inertia
    else:
        x[OWED] = spring + inertia - x[GIVEN]
        x[Y], x[V], x[SIDE], x[D], x[W] = y, v, side, d, w
        at_end = (1.0 - seated) * (k * y + b * v) + seated * seat_at_end
        s[st.SPRING_TORQUE] += at_end - k * d - b * w
        s[st.PLAY] = (1.0 - seated) * (y - d) - seated * min(max(d, -half), half)


_SHARES = (0.1, 0.3, 0.6)
"""Of the travel that may be play: a tenth hardly shows, much more than half leaves nothing for the spring."""


_OF_JOINTS = (1e-3, 3e-3, 0.01, 0.03)
"""rad: from a good gear's to a toy servo's; the residual has a minimum about each."""


def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Begin also at shares of the travel; a nearly unknown spring then starts correspondingly stiffer.

    A joint travels much farther than its play, so its travel does not show the size of the play.
    """
    if view.is_joint:
        return [{**defaults[0], "gap": gap} for gap in _OF_JOINTS]
    travel = view.travel()
    if travel is None:
        return list(defaults)
    gaps: list[Guess] = [{"gap": share * travel} for share in _SHARES]
    if not view.rigid_spring and not view.is_well_known(STIFFNESS):
        k = view.value(STIFFNESS)
        gaps += [{"gap": share * travel, STIFFNESS: k / (1.0 - share)} for share in _SHARES]
    return [*defaults, *({**defaults[0], **gap} for gap in gaps)]


EFFECT = Effect(
    name="backlash",
    port=st.Port.SPRING,
    parameters=(
        Parameter(
            "gap", "rad", null=0.0, low=0.0, high=0.1, typical=4e-3, starts=(1e-3, 0.012), is_fixed=True,
            reason="it does not depend on the size of the machine: 3 to 6 arcmin in a good gear, 0.03 rad "
            "in a toy servo",
        ),
        Parameter(
            "on_gear", "1", null=0.0, low=0.0, high=1.0, typical=0.0, optional=True,
            reason="a share of the chassis",
        ),
    ),
    claims=Claims("position", "odd", amplitude_exponent=None, passive=True, confusable_with=("hard_stop",)),
    function=apply,
    states=8,
    reads=(st.DEFLECTION, st.DEFLECTION_RATE),
    guesses=guesses,
    tags=("play",),
    compensation=Gap(lambda p: p[0]),
    about="play between the gear output and the spring",
    inspect="flexspline screws, set screws, keys and couplings, bearing preload; with two encoders, "
    "the side that moves alone is the loose one",
)
